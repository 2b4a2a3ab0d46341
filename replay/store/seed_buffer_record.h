// The record of the offline data, the seed buffer, that a store was begun with.
#pragma once

#include <cstdint>

namespace dbr {

// The record as it lies in the store's file: its layout is a format on disk (StoreFile, kFormat). Returns are
// the undiscounted ones of the data's whole episodes; NaN where it has none.
struct SeedBufferRecord {
  std::uint64_t complete = 0;  // 1 once all of the seed buffer is in the store
  std::uint64_t rows = 0;      // rows of the seed buffer, with the keys 1 to `rows`
  std::uint64_t pinned = 0;    // how many of them are never evicted: all or none
  // Rows of the file that were left out: a value is not finite, or a flag neither 0 nor 1.
  std::uint64_t bad_rows = 0;
  std::uint64_t episodes = 0;  // whole ones
  double return_mean = 0;
  double return_std = 0;
  double return_min = 0;
  double return_max = 0;
  double rows_per_second = 0;  // the speed at which they were loaded
  // Rows of the file with an action outside [-1, 1]; 0 where an older program wrote the record.
  std::uint64_t actions_outside = 0;
};

}  // namespace dbr
