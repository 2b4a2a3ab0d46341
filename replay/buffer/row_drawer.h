// Drawing rows of the replay buffer at random.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/rng.h"
#include "replay/buffer/buffer_types.h"
#include "replay/buffer/columns.h"
#include "replay/buffer/partitions.h"
#include "replay/store/transition_store.h"

namespace dbr {

// Chooses rows of a partition with replacement, each with the same probability, and copies them. The share of
// the seed buffer may be set apart from its size. Allocates nothing once the counts have settled.
// Thread-compatible: the buffer's mutex guards it, with the store and the partitions.
class RowDrawer {
 public:
  // `seed`: of the random numbers. `store` and `partitions` are not owned and outlive this.
  RowDrawer(const SeedBufferShare& share, std::uint64_t seed, const TransitionStore* store,
            const Partitions* partitions);

  // Writes `count` rows of `part` (Part), and their keys, to the first `count` places of each column of
  // `out`. `share`: of the seed buffer, in place of that of the constructor. Requires that the part is not
  // empty, or a count of 0. O(count).
  void Draw(int part, std::uint32_t count, std::optional<double> share, const DrawColumns& out);

 private:
  // Fills slots_.
  void ChooseSlots(int part, std::uint32_t count, std::optional<double> share);

  const SeedBufferShare share_;
  const TransitionStore& store_;
  const Partitions& partitions_;
  Rng rng_;
  std::vector<std::uint32_t> slots_;  // of the rows that are drawn
};

}  // namespace dbr
