#include "replay/dataset/next_action_reader.h"

#include <algorithm>
#include <utility>

#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr int kChunk = 4096;

TransitionLayout WithNextAction(TransitionLayout layout) {
  layout.next_action_width = layout.action_width;
  return layout;
}

}  // namespace

NextActionReader::NextActionReader(DatasetReader* reader)
    : reader_(reader),
      layout_(WithNextAction(reader->transition_layout())),
      chunk_(reader->transition_layout(), kChunk),
      waiting_(static_cast<std::size_t>(layout_.stride())),
      nothing_(static_cast<std::size_t>(layout_.action_width), 0.0f) {}

absl::StatusOr<absl::Span<const float>> NextActionReader::Next() {
  rows_.clear();
  starts_.clear();
  while (rows_.empty()) {
    ASSIGN_OR_RETURN(const int size, reader_->Next(&chunk_));
    for (int i = 0; i < size; ++i) Take(i);
    if (size > 0) continue;
    EndWaiting();
    break;
  }
  return absl::MakeConstSpan(rows_);
}

void NextActionReader::Take(int i) {
  const TransitionView row = ViewRow(chunk_.row(i), chunk_.layout);
  const bool starts = chunk_.starts[static_cast<std::size_t>(i)] != 0 || !Follows(row);
  if (starts) {
    EndWaiting();
  } else if (waits_) {
    KeepWaiting(row.action);
  }
  TransitionView kept = row;
  kept.next_action = nothing_;  // until it is known
  WriteRow(kept, layout_, waiting_.data());
  waits_ = true;
  waiting_starts_ = starts;
}

bool NextActionReader::Follows(const TransitionView& row) const {
  return !waits_ || ViewRow(waiting_.data(), layout_).next_observation == row.observation;
}

void NextActionReader::EndWaiting() {
  if (waits_ && ViewRow(waiting_.data(), layout_).discount == 0) KeepWaiting(nothing_);
  waits_ = false;
}

void NextActionReader::KeepWaiting(absl::Span<const float> next_action) {
  std::copy(next_action.begin(), next_action.end(), waiting_.begin() + layout_.next_action_offset());
  rows_.insert(rows_.end(), waiting_.begin(), waiting_.end());
  starts_.push_back(waiting_starts_);
  waits_ = false;
}

}  // namespace dbr
