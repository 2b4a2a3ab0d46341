// What a store knows of the offline data that it was begun with.
#pragma once

#include <cstdint>

namespace dbr {

// As it lies in the store's file. Returns are those of the data's whole episodes; NaN where it has none.
struct SeedBufferRecord {
  std::uint64_t complete = 0;  // 1 once all of the seed buffer is in the store
  std::uint64_t rows = 0;      // the rows with the keys 1 to `rows`
  std::uint64_t pinned = 0;    // of them, never evicted: all or none
  std::uint64_t bad_rows = 0;  // left out: with values that are not finite
  std::uint64_t episodes = 0;
  double return_mean = 0;
  double return_std = 0;
  double return_min = 0;
  double return_max = 0;
  double rows_per_second = 0;  // at which they came in
};

}  // namespace dbr
