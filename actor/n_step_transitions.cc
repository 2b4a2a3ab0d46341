#include "actor/n_step_transitions.h"

#include <utility>

#include "core/status_macros.h"

namespace dbr {

NStepTransitions::NStepTransitions(const TransitionLayout& layout, int envs, int n, TransitionSink sink)
    : sink_(std::move(sink)), steps_(static_cast<std::size_t>(envs), NStepAccumulator(layout, n)) {}

absl::Status NStepTransitions::Add(int env, const TransitionView& step, const FirstJudgement& judgement,
                                   const std::optional<EpisodeEnd>& end) {
  const auto emit = [&](const TransitionView& transition, const FirstJudgement& first, bool is_last) {
    return sink_(transition, first.advantage, first.critic_version, is_last ? end : std::nullopt);
  };
  return steps_[static_cast<std::size_t>(env)].Add(step, judgement, end.has_value(), emit);
}

absl::Status NStepTransitions::Flush() {
  const auto emit = [this](const TransitionView& transition, const FirstJudgement& first, bool) {
    return sink_(transition, first.advantage, first.critic_version, std::nullopt);
  };
  for (NStepAccumulator& steps : steps_) RETURN_IF_ERROR(steps.Flush(emit));
  return absl::OkStatus();
}

std::uint64_t NStepTransitions::held() const {
  std::uint64_t held = 0;
  for (const NStepAccumulator& steps : steps_) held += steps.waiting();
  return held;
}

}  // namespace dbr
