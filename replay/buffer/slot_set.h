// A set of the store's slots that a random one can be drawn from.
#pragma once

#include <cstdint>
#include <vector>

#include "core/rng.h"

namespace dbr {

// Slots are row numbers of the store, below the capacity that the set is made with. Those of the seed buffer
// stand before the others, so that either kind can be drawn from alone. Every operation is O(1). Takes 8
// bytes a slot. Thread-compatible: the buffer's mutex guards it.
//
//   members_   | 7 | 2 | 9 |           the slots of the set, without gaps; here 7 and 2 are the seed buffer's
//   places_      .   .   1   .  .  .  .  0  .  2     where slots 0 to 9 stand in members_; "." is absent
class SlotSet {
 public:
  explicit SlotSet(std::uint32_t capacity);

  // Requires that the slot is not in the set.
  void Insert(std::uint32_t slot, bool of_seed_buffer);
  // Requires that the slot is in the set; other members take its place.
  void Remove(std::uint32_t slot);
  bool Contains(std::uint32_t slot) const;
  std::uint32_t size() const { return static_cast<std::uint32_t>(members_.size()); }
  std::uint32_t seed_buffer() const { return seed_buffer_; }      // members of the seed buffer
  std::uint32_t others() const { return size() - seed_buffer_; }  // the other members

  // Draws a member, a member of the seed buffer or one of the others, each of them with the same
  // probability, and leaves it in the set. Requires that there is one.
  std::uint32_t Draw(Rng* rng) const { return members_[rng->Below(size())]; }
  std::uint32_t DrawSeedBuffer(Rng* rng) const { return members_[rng->Below(seed_buffer_)]; }
  std::uint32_t DrawOther(Rng* rng) const { return members_[seed_buffer_ + rng->Below(others())]; }

 private:
  // Makes `slot` the member at `place`.
  void Put(std::uint32_t slot, std::uint32_t place);

  std::vector<std::uint32_t> members_;
  std::vector<std::uint32_t> places_;
  std::uint32_t seed_buffer_ = 0;
};

}  // namespace dbr
