#include "replay/dataset/n_step_rows.h"

#include <algorithm>

#include "core/check.h"

namespace dbr {

NStepRows::NStepRows(const TransitionLayout& layout, int n) : layout_(layout), steps_(layout, n) {
  DBR_CHECK(n > 1);
}

void NStepRows::Add(const float* row, bool starts) {
  if (starts || !Follows(row)) Finish();
  const auto append = [this](const TransitionView& transition, const FirstJudgement&, bool) {
    return Append(transition);
  };
  DBR_CHECK(steps_.Add(ViewRow(row, layout_), {}, /*ends=*/false, append).ok());
}

void NStepRows::Finish() {
  const auto append = [this](const TransitionView& transition, const FirstJudgement&, bool) {
    return Append(transition);
  };
  DBR_CHECK(steps_.Flush(append).ok());
}

bool NStepRows::Follows(const float* row) const {
  if (steps_.waiting() == 0) return true;
  const absl::Span<const float> before = steps_.newest().next_observation;
  return std::equal(before.begin(), before.end(), row);
}

absl::Status NStepRows::Append(const TransitionView& transition) {
  const std::size_t end = rows_.size();
  rows_.resize(end + static_cast<std::size_t>(layout_.stride()));
  WriteRow(transition, layout_, rows_.data() + end);
  return absl::OkStatus();
}

}  // namespace dbr
