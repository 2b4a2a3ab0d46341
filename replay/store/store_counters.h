// The counters of a store, which lie in its file beside the rows.
#pragma once

#include <cstdint>

namespace dbr {

// Counters over the life of the store; its file begins with zeros. Their layout is a format on disk
// (StoreFile, kFormat). They count rows unless they say otherwise.
struct StoreCounters {
  std::uint64_t sampled;          // drawn
  std::uint64_t sampled_offline;  // drawn while there were none but the seed buffer's
  std::uint64_t relabelled;
  std::uint64_t relabel_evicted;  // to be relabelled, but no longer held
  std::uint64_t relabel_stale;    // to be relabelled, but with a newer label already
  std::uint64_t relabel_refused;  // to be relabelled, with an advantage that is not finite
  std::uint64_t refused;          // not stored: with values that make no sense (replay/buffer/row_check.h)
  std::uint64_t duplicates;       // not stored: sent again
  std::uint64_t newest_label;     // the greatest critic version that gave a label
  std::uint64_t episodes;         // episodes that ended
};

}  // namespace dbr
