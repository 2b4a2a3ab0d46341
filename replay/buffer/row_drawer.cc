#include "replay/buffer/row_drawer.h"

#include <cstddef>
#include <cstring>

namespace dbr {

RowDrawer::RowDrawer(const SeedBufferShare& share, std::uint64_t seed, const TransitionStore* store,
                     const Partitions* partitions)
    : share_(share), store_(*store), partitions_(*partitions), rng_(seed) {}

void RowDrawer::ChooseSlots(int part, std::uint32_t count, std::optional<double> share) {
  slots_.resize(count);
  const SlotSet& members = partitions_[part];
  if (!share.has_value() && !share_.follows_sizes()) share = share_.At(store_.online_inserted());
  if (!share.has_value() || members.seed_buffer() == 0 || members.others() == 0) {
    for (std::uint32_t& slot : slots_) slot = members.Draw(&rng_);
    return;
  }
  // The expected number of seed buffer rows is exact: what is left of a whole number is drawn by chance.
  const auto of_seed_buffer = static_cast<std::size_t>(*share * count + rng_.Uniform());
  for (std::size_t i = 0; i < count; ++i) {
    slots_[i] = i < of_seed_buffer ? members.DrawSeedBuffer(&rng_) : members.DrawOther(&rng_);
  }
}

void RowDrawer::Draw(int part, std::uint32_t count, std::optional<double> share, const DrawColumns& out) {
  ChooseSlots(part, count, share);
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
