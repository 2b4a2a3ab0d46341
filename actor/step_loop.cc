#include "actor/step_loop.h"

#include <limits>
#include <utility>

#include "core/status_macros.h"

namespace dbr {

StepLoop::StepLoop(std::unique_ptr<VectorEnv> envs, const StepLoopOptions& options, const Rng& rng,
                   TransitionSink sink)
    : envs_(std::move(envs)),
      options_(options),
      exploration_(envs_->spec().actions, options.exploration, envs_->size()),
      rng_(rng),
      sink_(std::move(sink)),
      actions_(MatrixX<float>::Zero(envs_->spec().actions.width(), envs_->size())),
      advantages_(VectorX<float>::Zero(envs_->size())),
      episodes_(envs_->size()) {
  for (int i = 0; i < envs_->size(); ++i) envs_->Reset(i, rng_());
}

absl::Status StepLoop::Step(const PolicyNetworks& policy) {
  RETURN_IF_ERROR(runner_.Act(policy, options_.mode, envs_->observations(), envs_->masks(), rng_, actions_));
  counters_.explored += exploration_.Apply(envs_->masks(), rng_, &actions_);
  runner_.Advantages(actions_, rng_, advantages_);
  for (int i = 0; i < envs_->size(); ++i) {
    envs_->Step(i, actions_);
    RETURN_IF_ERROR(Emit(i, policy.snapshot().version));
  }
  envs_->Advance();
  for (int i = 0; i < envs_->size(); ++i) {
    if (!envs_->results()[i].done()) continue;
    envs_->Reset(i, rng_());
    episodes_[i] = {};
  }
  return absl::OkStatus();
}

absl::Status StepLoop::Emit(int i, std::uint64_t critic_version) {
  const StepResult& result = envs_->results()[i];
  Episode& episode = episodes_[i];
  episode.episode_return += result.reward;
  ++episode.length;
  const TransitionView transition = {
      .observation = Column(envs_->observations(), i),
      .action = Column(actions_, i),
      .mask = Column(envs_->masks(), i),
      .reward = result.reward,
      .discount = result.terminated ? 0.0f : static_cast<float>(options_.discount),
      .next_observation = Column(envs_->next_observations(), i),
      .next_mask = Column(envs_->next_masks(), i),
  };
  std::optional<EpisodeEnd> end;
  if (result.done()) {
    end =
        EpisodeEnd{.episode_return = static_cast<float>(episode.episode_return),
                   .score = envs_->spec().has_score ? result.score : std::numeric_limits<float>::quiet_NaN(),
                   .length = episode.length};
  }
  RETURN_IF_ERROR(sink_(transition, advantages_[i], critic_version, end));
  ++counters_.transitions;
  if (end.has_value()) ++counters_.episodes;
  if (result.broken) ++counters_.broken;
  return absl::OkStatus();
}

}  // namespace dbr
