#include "replay/dataset/row_window.h"

#include <algorithm>
#include <initializer_list>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/status_macros.h"
#include "replay/dataset/end_keys.h"

namespace dbr {
namespace {

constexpr int kMaxKeysInMessage = 12;
constexpr char kEpisodeTerminals[] = "episode_terminals";
constexpr absl::string_view kEndKeys[] = {"terminals", "timeouts", kEpisodeTerminals};

std::vector<std::string> Missing(const Hdf5File& file, std::initializer_list<const char*> keys) {
  std::vector<std::string> missing;
  for (const char* const key : keys) {
    if (!file.Has(key)) missing.push_back(absl::StrCat("'", key, "'"));
  }
  return missing;
}

// Checks that the keys are those of a flat layout. Where other keys than those of the ends are missing the
// file is of another layout altogether, which is to be said first.
absl::Status CheckKeys(const Hdf5File& file) {
  if (Missing(file, {"observations", "actions", "rewards"}).empty()) {
    RETURN_IF_ERROR(CheckEndKeys(file, "", kEndKeys));
    if (file.Has("timeouts") && file.Has(kEpisodeTerminals)) {
      return absl::InvalidArgumentError(absl::StrCat(
          file.path(), ": expected one of 'timeouts' and 'episode_terminals', found both; take the ",
          "one out that does not hold"));
    }
  }
  const std::vector<std::string> missing = Missing(file, {"observations", "actions", "rewards", "terminals"});
  if (missing.empty()) return absl::OkStatus();
  std::vector<std::string> keys = file.Keys();
  if (keys.size() > kMaxKeysInMessage) {
    const std::size_t more = keys.size() - kMaxKeysInMessage;
    keys.resize(kMaxKeysInMessage);
    keys.push_back(absl::StrCat("and ", more, " more"));
  }
  return absl::InvalidArgumentError(
      absl::StrCat(file.path(), ": expected key ", absl::StrJoin(missing, ", "), ", found ",
                   keys.empty() ? "no keys" : absl::StrJoin(keys, ", "), "; is the file of another layout?"));
}

absl::Status CheckLength(const Hdf5File& file, const Hdf5Column& column, const Hdf5Column& observations) {
  if (column.rows() == observations.rows()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(file.path(), ": expected arrays of the same length, found ",
                                                 observations.rows(), " rows of 'observations' and ",
                                                 column.rows(), " of '", column.name(), "'"));
}

absl::Status CheckScalar(const Hdf5File& file, const Hdf5Column& column) {
  if (column.width() == 1) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(file.path(), ": expected one number a row in '",
                                                 column.name(), "', found ", column.width()));
}

}  // namespace

absl::StatusOr<FlatColumns> FlatColumns::Open(const Hdf5File& file, bool with_next_observations) {
  RETURN_IF_ERROR(CheckKeys(file));
  FlatColumns columns;
  ASSIGN_OR_RETURN(columns.observations, file.Column("observations"));
  ASSIGN_OR_RETURN(columns.actions, file.Column("actions"));
  ASSIGN_OR_RETURN(columns.rewards, file.Column("rewards"));
  ASSIGN_OR_RETURN(columns.terminals, file.Column("terminals"));
  std::vector<const Hdf5Column*> scalars = {&columns.rewards, &columns.terminals};
  for (const char* const key : {"timeouts", kEpisodeTerminals}) {
    if (!file.Has(key)) continue;
    ASSIGN_OR_RETURN(columns.timeouts, file.Column(key));
    columns.timeouts_at_every_end = key == kEpisodeTerminals;
    scalars.push_back(&*columns.timeouts);
  }
  for (const Hdf5Column* const column : scalars) {
    RETURN_IF_ERROR(CheckScalar(file, *column));
    RETURN_IF_ERROR(CheckLength(file, *column, columns.observations));
  }
  RETURN_IF_ERROR(CheckLength(file, columns.actions, columns.observations));
  if (!with_next_observations || !file.Has("next_observations")) return columns;
  ASSIGN_OR_RETURN(columns.next_observations, file.Column("next_observations"));
  RETURN_IF_ERROR(CheckLength(file, *columns.next_observations, columns.observations));
  if (columns.next_observations->width() != columns.observations.width()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file.path(), ": expected 'next_observations' as wide as 'observations' (",
                     columns.observations.width(), "), found ", columns.next_observations->width()));
  }
  return columns;
}

RowWindow::RowWindow(FlatColumns columns, bool flags_only)
    : columns_(std::move(columns)), flags_only_(flags_only) {}

absl::StatusOr<bool> RowWindow::Advance() {
  const std::int64_t left = columns_.rewards.rows() - next_row_;
  const int kept = rows_ > 0 ? 1 : 0;
  const int count = static_cast<int>(std::min<std::int64_t>(left, kStretch));
  if (count == 0) return false;
  RETURN_IF_ERROR(Fill(kept, count));
  next_row_ += count;
  rows_ = kept + count;
  return true;
}

absl::Status RowWindow::Fill(int kept, int count) {
  const std::uint8_t kept_mark = kept > 0 ? marks_[rows_ - 1] : 0;
  marks_.assign(kept + count, 0);
  RETURN_IF_ERROR(FillFlags(columns_.terminals, kept, count, &terminals_));
  if (columns_.timeouts.has_value()) RETURN_IF_ERROR(FillFlags(*columns_.timeouts, kept, count, &timeouts_));
  if (columns_.timeouts_at_every_end) KeepCuts(kept, count);
  if (!flags_only_) RETURN_IF_ERROR(FillValues(kept, count));
  CountMarks(absl::MakeConstSpan(marks_).subspan(kept), next_row_, &faults_);
  if (kept > 0) marks_[0] = kept_mark;
  return absl::OkStatus();
}

// Makes marks of the last rows of episodes marks of cuts. A terminal that no episode ends with contradicts
// itself.
void RowWindow::KeepCuts(int kept, int count) {
  for (int i = kept; i < kept + count; ++i) {
    if (terminals_[i] != 0 && timeouts_[i] == 0) marks_[i] |= kBadFlag;
    if (terminals_[i] != 0) timeouts_[i] = 0;
  }
}

absl::Status RowWindow::FillValues(int kept, int count) {
  RETURN_IF_ERROR(FillFloats(columns_.observations, kept, count, &observations_));
  RETURN_IF_ERROR(FillFloats(columns_.actions, kept, count, &actions_));
  RETURN_IF_ERROR(FillFloats(columns_.rewards, kept, count, &rewards_));
  if (columns_.next_observations.has_value()) {
    RETURN_IF_ERROR(FillFloats(*columns_.next_observations, kept, count, &next_observations_));
  }
  const std::size_t width = columns_.actions.width();
  faults_.actions_outside += CountOutside(absl::MakeConstSpan(actions_).subspan(kept * width, count * width),
                                          columns_.actions.width(), marks_.data() + kept);
  return absl::OkStatus();
}

absl::Status RowWindow::FillFloats(const Hdf5Column& column, int kept, int count,
                                   std::vector<float>* values) {
  const std::size_t width = column.width();
  values->resize(std::max(values->size(), (kept + count) * width));
  if (kept > 0) std::copy_n(values->data() + (rows_ - 1) * width, width, values->data());
  RETURN_IF_ERROR(column.ReadFloats(next_row_, count, values->data() + kept * width));
  MarkNotFinite({values->data(), (kept + count) * width}, column.width(), &marks_);
  return absl::OkStatus();
}

absl::Status RowWindow::FillFlags(const Hdf5Column& column, int kept, int count,
                                  std::vector<std::uint8_t>* flags) {
  flags->resize(std::max<std::size_t>(flags->size(), kept + count));
  if (kept > 0) (*flags)[0] = (*flags)[rows_ - 1];
  RETURN_IF_ERROR(column.ReadFlags(next_row_, count, flags->data() + kept));
  MarkBadFlags(absl::MakeSpan(*flags).subspan(kept, count), marks_.data() + kept);
  return absl::OkStatus();
}

}  // namespace dbr
