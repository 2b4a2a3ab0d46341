#include "replay/store/writer_table.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

absl::Status CheckIdentity(const WriterIdentity& identity) {
  if (identity.id == 0)
    return absl::InvalidArgumentError("writer_id: expected a number other than 0, found 0");
  constexpr std::size_t kMaxName = sizeof(WriterRecord::name) - 1;
  if (identity.name.empty() || identity.name.size() > kMaxName) {
    return absl::InvalidArgumentError(absl::StrCat("writer_name: expected 1 to ", kMaxName, " bytes, found ",
                                                   identity.name.size(),
                                                   ". Name the process, for example actor-0."));
  }
  return absl::OkStatus();
}

}  // namespace

WriterTable::WriterTable(WriterRecord* records) : records_(records), volatile_(kPlaces) {
  for (std::uint32_t place = 0; place < kPlaces; ++place) {
    WriterRecord& record = records_[place];
    if (record.id == 0) continue;
    record.name[sizeof record.name - 1] = '\0';
    places_.emplace(record.id, place);
    openings_ = std::max(openings_, record.opened);
  }
}

absl::StatusOr<std::uint32_t> WriterTable::FindFreePlace() const {
  std::uint32_t best = kPlaces;
  std::uint64_t best_opened = std::numeric_limits<std::uint64_t>::max();
  for (std::uint32_t place = 0; place < kPlaces; ++place) {
    if (records_[place].id == 0) return place;
    if (volatile_[place].held != 0 || volatile_[place].streams != 0) continue;
    if (records_[place].opened < best_opened) {
      best = place;
      best_opened = records_[place].opened;
    }
  }
  if (best != kPlaces) return best;
  return absl::ResourceExhaustedError(absl::StrCat(
      "the replay server knows ", kPlaces,
      " writers that are connected or have transitions in the buffer, and can take no more for now"));
}

absl::StatusOr<std::uint32_t> WriterTable::Open(const WriterIdentity& identity) {
  RETURN_IF_ERROR(CheckIdentity(identity));
  const auto known = places_.find(identity.id);
  std::uint32_t place;
  if (known != places_.end()) {
    place = known->second;
  } else {
    ASSIGN_OR_RETURN(place, FindFreePlace());
    places_.erase(records_[place].id);
    records_[place] = WriterRecord{};
    volatile_[place] = Volatile{};
    places_.emplace(identity.id, place);
  }
  WriterRecord& record = records_[place];
  std::memset(record.name, 0, sizeof record.name);
  std::memcpy(record.name, identity.name.data(), identity.name.size());
  record.source = identity.source;
  record.opened = ++openings_;
  record.id = identity.id;
  ++volatile_[place].streams;
  return place;
}

}  // namespace dbr
