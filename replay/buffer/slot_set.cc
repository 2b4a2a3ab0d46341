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

void SlotSet::Insert(std::uint32_t slot) {
  DBR_CHECK(slot < places_.size() && places_[slot] == kAbsent);
  places_[slot] = size();
  members_.push_back(slot);
}

void SlotSet::Remove(std::uint32_t slot) {
  DBR_CHECK(Contains(slot));
  const std::uint32_t last = members_.back();
  members_[places_[slot]] = last;
  places_[last] = places_[slot];
  places_[slot] = kAbsent;
  members_.pop_back();
}

bool SlotSet::Contains(std::uint32_t slot) const {
  return slot < places_.size() && places_[slot] != kAbsent;
}

}  // namespace dbr
