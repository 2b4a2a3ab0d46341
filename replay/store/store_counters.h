// What a store counts, in its file beside the rows.
#pragma once

#include <cstdint>

namespace dbr {

// Counters that live as long as the store.
struct StoreCounters {
  std::uint64_t sampled;
  std::uint64_t sampled_offline;  // of them, before the first row that is no seed buffer
  std::uint64_t relabelled;
  std::uint64_t relabel_evicted;
  std::uint64_t relabel_stale;
  std::uint64_t relabel_refused;
  std::uint64_t refused;
  std::uint64_t duplicates;
  std::uint64_t newest_label;  // greatest critic version of a label
  std::uint64_t episodes;
};

}  // namespace dbr
