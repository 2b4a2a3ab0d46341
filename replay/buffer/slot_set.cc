#include "replay/buffer/slot_set.h"

#include <limits>

#include "core/check.h"

namespace dbr {
namespace {

constexpr std::uint32_t kAbsent = std::numeric_limits<std::uint32_t>::max();

}  // namespace

SlotSet::SlotSet(std::uint32_t capacity) : places_(capacity, kAbsent) {
  members_.reserve(capacity);
}

void SlotSet::Put(std::uint32_t slot, std::uint32_t place) {
  members_[place] = slot;
  places_[slot] = place;
}

void SlotSet::Insert(std::uint32_t slot, bool of_seed_buffer) {
  DBR_CHECK(slot < places_.size() && places_[slot] == kAbsent);
  members_.push_back(slot);
  if (!of_seed_buffer) return Put(slot, size() - 1);
  // The first of the others makes room at the end of the seed buffer's.
  Put(members_[seed_buffer_], size() - 1);
  Put(slot, seed_buffer_++);
}

void SlotSet::Remove(std::uint32_t slot) {
  DBR_CHECK(Contains(slot));
  std::uint32_t gap = places_[slot];
  if (gap < seed_buffer_) {
    Put(members_[--seed_buffer_], gap);
    gap = seed_buffer_;
  }
  if (gap + 1 < size()) Put(members_.back(), gap);
  members_.pop_back();
  places_[slot] = kAbsent;
}

bool SlotSet::Contains(std::uint32_t slot) const {
  return slot < places_.size() && places_[slot] != kAbsent;
}

}  // namespace dbr
