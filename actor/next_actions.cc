#include "actor/next_actions.h"

#include <utility>

#include "core/check.h"
#include "core/status_macros.h"

namespace dbr {

NextActions::NextActions(const TransitionLayout& layout, int envs, NextActionSink sink)
    : layout_(layout),
      sink_(std::move(sink)),
      nothing_(static_cast<std::size_t>(layout.action_width), 0.0f),
      waiting_(static_cast<std::size_t>(envs)) {
  DBR_CHECK(layout.next_action_width == layout.action_width);
  for (Waiting& waiting : waiting_) waiting.row.resize(static_cast<std::size_t>(layout.stride()));
}

absl::Status NextActions::Add(int env, const TransitionView& transition, const FirstJudgement& judgement,
                              const std::optional<EpisodeEnd>& end, absl::Span<const float> cut_action) {
  Waiting& waiting = waiting_[static_cast<std::size_t>(env)];
  if (std::exchange(waiting.holds, false)) {
    --held_;
    RETURN_IF_ERROR(PassOn(env, ViewRow(waiting.row.data(), layout_), waiting.judgement, std::nullopt,
                           transition.action));
  }
  if (end.has_value()) {
    return PassOn(env, transition, judgement, end, transition.discount > 0 ? cut_action : nothing_);
  }
  TransitionView kept = transition;
  kept.next_action = nothing_;  // until it is known
  WriteRow(kept, layout_, waiting.row.data());
  waiting.judgement = judgement;
  waiting.holds = true;
  ++held_;
  return absl::OkStatus();
}

absl::Status NextActions::PassOn(int env, TransitionView transition, const FirstJudgement& judgement,
                                 const std::optional<EpisodeEnd>& end, absl::Span<const float> next_action) {
  transition.next_action = next_action;
  return sink_(env, transition, judgement, end);
}

}  // namespace dbr
