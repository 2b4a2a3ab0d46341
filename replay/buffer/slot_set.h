// A set of the store's slots that a random one can be drawn from.
#pragma once

#include <cstdint>
#include <vector>

#include "core/rng.h"

namespace dbr {

// Slots are row numbers of the store, below the capacity that the set is made with. Every operation is O(1).
// Takes 8 bytes a slot. Thread-compatible: the buffer's mutex guards it.
//
//   members_   | 7 | 2 | 9 |           the slots of the set, without gaps
//   places_      .   .   1   .  .  .  .  0  .  2     where slots 0 to 9 stand in members_; "." is absent
class SlotSet {
 public:
  explicit SlotSet(std::uint32_t capacity);

  void Insert(std::uint32_t slot);  // requires that the slot is not in the set
  void Remove(std::uint32_t slot);  // requires that the slot is in the set; the last member takes its place
  bool Contains(std::uint32_t slot) const;
  std::uint32_t size() const { return static_cast<std::uint32_t>(members_.size()); }

  // Draws a slot, each with the same probability, and leaves it in the set. Requires that the set is not
  // empty.
  std::uint32_t Draw(Rng* rng) const { return members_[rng->Below(size())]; }

 private:
  std::vector<std::uint32_t> members_;
  std::vector<std::uint32_t> places_;
};

}  // namespace dbr
