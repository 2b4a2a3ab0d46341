#include "replay/buffer/row_drawer.h"

#include <cstddef>
#include <cstring>

namespace dbr {

RowDrawer::RowDrawer(double seed_buffer_share, std::uint64_t seed, const TransitionStore* store,
                     const Partitions* partitions)
    : seed_buffer_share_(seed_buffer_share), store_(*store), partitions_(*partitions), rng_(seed) {}

// A share is drawn by row numbers: the rows of each kind have numbers without gaps, the seed buffer's first.
void RowDrawer::ChooseSlots(int part, std::uint32_t count) {
  slots_.resize(count);
  const auto seed_buffer = static_cast<std::uint32_t>(store_.seed_buffer_held());
  const std::uint32_t others = partitions_.size(kAll) - seed_buffer;
  if (part != kAll || seed_buffer_share_ == 0 || seed_buffer == 0 || others == 0) {
    for (auto& slot : slots_) slot = partitions_[part].Draw(&rng_);
    return;
  }
  // The expected number of seed buffer rows is exact: what is left of a whole number is drawn by chance.
  const auto from_seed_buffer = static_cast<std::size_t>(seed_buffer_share_ * count + rng_.Uniform());
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t rank =
        i < from_seed_buffer ? rng_.Below(seed_buffer) : seed_buffer + rng_.Below(others);
    slots_[i] = store_.SlotOf(store_.KeyAtRank(rank));
  }
}

void RowDrawer::Draw(int part, std::uint32_t count, const DrawColumns& out) {
  ChooseSlots(part, count);
  const ColumnSet<ColumnPlace> places = store_.layout().columns();
  constexpr std::size_t kAhead = 8;  // rows lie at random: ask for them before they are needed
  for (std::size_t i = 0; i < count; ++i) {
    if (i + kAhead < count) __builtin_prefetch(store_.row(slots_[i + kAhead]));
    const float* row = store_.row(slots_[i]);
    out.keys[i] = store_.KeyAt(slots_[i]);
    ForEachColumn(
        [row, i](const ColumnPlace& place, float* column) {
          const auto width = static_cast<std::size_t>(place.width);
          if (width > 0) std::memcpy(column + i * width, row + place.offset, width * sizeof(float));
        },
        places, out);
  }
}

}  // namespace dbr
