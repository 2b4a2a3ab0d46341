// The partitions of the replay buffer: which rows lie in D, D+, D-, and which no critic has judged yet.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "replay/buffer/slot_set.h"
#include "replay/store/writer_table.h"

namespace dbr {

// D holds all rows, D+ those with an advantage >= 0, D- those with one <= -margin, which is <= 0 unless
// DbrConfig.minus_margin says more. The first three can be drawn from.
enum Part { kAll = 0, kPlus = 1, kMinus = 2, kUnjudgedPart = 3 };
inline constexpr int kDrawnParts = 3;
inline constexpr int kAllParts = 4;

// The slots of each part, to draw from:
//
//   advantage    NaN          > 0       0            < 0
//   parts        D, unjudged  D, D+     D, D+, D-    D, D-
//
// With a margin above 0 a row with an advantage of 0 is not in D-, and one between -margin and 0 is in D
// alone. Knows slots and advantages, not rows. Every operation is O(1). Thread-compatible: the buffer's mutex
// guards it.
class Partitions {
 public:
  // All parts are empty. `capacity`: slots of the store.
  explicit Partitions(std::uint32_t capacity, float margin = 0)
      : margin_(margin), parts_{SlotSet(capacity), SlotSet(capacity), SlotSet(capacity), SlotSet(capacity)} {}

  // A row with its advantage (NaN: not yet judged) enters, leaves, or has its advantage changed from
  // `old_advantage`.
  void Add(std::uint32_t slot, float advantage, Source source) {
    parts_[kAll].Insert(slot, source == Source::kSeedBuffer);
    Join(slot, advantage, source);
  }
  void Remove(std::uint32_t slot, float advantage) {
    parts_[kAll].Remove(slot);
    Leave(slot, advantage);
  }
  void Relabel(std::uint32_t slot, float old_advantage, float advantage, Source source) {
    if (Code(old_advantage) == Code(advantage)) return;
    Leave(slot, old_advantage);
    Join(slot, advantage, source);
  }

  const SlotSet& operator[](int part) const { return parts_[part]; }
  std::uint32_t size(int part) const { return parts_[part].size(); }
  // Rows of the part that are the seed buffer's.
  std::uint64_t seed_buffer(int part) const { return parts_[part].seed_buffer(); }

 private:
  // The parts beside D that a row of that advantage lies in, as bits.
  unsigned Code(float advantage) const {
    if (std::isnan(advantage)) return 1u << kUnjudgedPart;
    return (advantage >= 0 ? 1u << kPlus : 0) | (advantage <= -margin_ ? 1u << kMinus : 0);
  }
  void Join(std::uint32_t slot, float advantage, Source source) {
    for (int part = kPlus; part < kAllParts; ++part) {
      if ((Code(advantage) >> part & 1) != 0) parts_[part].Insert(slot, source == Source::kSeedBuffer);
    }
  }
  void Leave(std::uint32_t slot, float advantage) {
    for (int part = kPlus; part < kAllParts; ++part) {
      if ((Code(advantage) >> part & 1) != 0) parts_[part].Remove(slot);
    }
  }

  const float margin_;
  std::array<SlotSet, kAllParts> parts_;
};

}  // namespace dbr
