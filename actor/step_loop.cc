#include "actor/step_loop.h"

#include <limits>
#include <utility>

#include "core/check.h"
#include "core/status_macros.h"

namespace dbr {

StepLoop::StepLoop(std::unique_ptr<VectorEnv> envs, const StepLoopOptions& options, const Rng& rng,
                   TransitionSink sink)
    : envs_(std::move(envs)),
      options_(options),
      exploration_(envs_->spec().actions, options.exploration, envs_->size()),
      rng_(rng),
      n_step_(std::make_unique<NStepTransitions>(TransitionLayout::Of(envs_->spec(), options.columns),
                                                 envs_->size(), options.n_step, std::move(sink))),
      actions_(MatrixX<float>::Zero(envs_->spec().actions.width(), envs_->size())),
      advantages_(VectorX<float>::Zero(envs_->size())),
      cut_actions_(MatrixX<float>::Zero(envs_->spec().actions.width(), envs_->size())),
      next_values_(VectorX<float>::Zero(envs_->size())),
      episodes_(envs_->size()) {
  DBR_CHECK(!options.columns.returns || !options.columns.next_actions);
  const TransitionLayout layout = TransitionLayout::Of(envs_->spec(), options.columns);
  if (options.columns.next_actions) {
    const auto add = [n_step = n_step_.get()](int env, const TransitionView& step,
                                              const FirstJudgement& judgement,
                                              const std::optional<EpisodeEnd>& end) {
      return n_step->Add(env, step, judgement, end);
    };
    next_actions_.emplace(layout, envs_->size(), add);
  }
  if (options.columns.returns) {
    // Episodes come whole, one after another, so that they may all be steps of environment 0.
    const auto add = [n_step = n_step_.get()](const TransitionView& step, float advantage,
                                              std::uint64_t critic_version,
                                              const std::optional<EpisodeEnd>& end) {
      return n_step->Add(0, step, {advantage, critic_version}, end);
    };
    returns_.emplace(layout, envs_->size(), ReturnOptions{options.reward_scale, options.discount}, add);
  }
  for (int i = 0; i < envs_->size(); ++i) envs_->Reset(i, rng_());
}

absl::Status StepLoop::Step(const PolicyNetworks& policy) {
  RETURN_IF_ERROR(runner_.Act(policy, options_.mode, envs_->observations(), envs_->masks(), rng_, actions_));
  counters_.explored += exploration_.Apply(envs_->masks(), rng_, &actions_);
  Judge(policy);
  for (int i = 0; i < envs_->size(); ++i) envs_->Step(i, actions_);
  FindCuts();
  if (returns_.has_value()) JudgeCuts(policy);
  if (next_actions_.has_value()) RETURN_IF_ERROR(ActAtCuts(policy));
  for (int i = 0; i < envs_->size(); ++i) RETURN_IF_ERROR(Emit(i, policy.snapshot().version));
  envs_->Advance();
  for (int i = 0; i < envs_->size(); ++i) {
    if (!envs_->results()[i].done()) continue;
    envs_->Reset(i, rng_());
    episodes_[i] = {};
  }
  return absl::OkStatus();
}

void StepLoop::Judge(const PolicyNetworks& policy) {
  if (returns_.has_value()) {
    runner_.Values(policy, envs_->observations(), envs_->masks(), rng_, advantages_);
  } else {
    runner_.Advantages(actions_, rng_, advantages_);
  }
}

void StepLoop::FindCuts() {
  cuts_.clear();
  if (!returns_.has_value() && !next_actions_.has_value()) return;
  for (int i = 0; i < envs_->size(); ++i) {
    const StepResult& result = envs_->results()[i];
    if (result.done() && !result.terminated) cuts_.push_back(i);
  }
  if (cuts_.empty()) return;
  cut_observations_ = envs_->next_observations()(Eigen::all, cuts_);
  cut_masks_ = envs_->next_masks()(Eigen::all, cuts_);
}

void StepLoop::JudgeCuts(const PolicyNetworks& policy) {
  if (cuts_.empty()) return;
  cut_values_.resize(static_cast<Eigen::Index>(cuts_.size()));
  runner_.Values(policy, cut_observations_, cut_masks_, rng_, cut_values_);
  next_values_(cuts_) = cut_values_;
}

absl::Status StepLoop::ActAtCuts(const PolicyNetworks& policy) {
  if (cuts_.empty()) return absl::OkStatus();
  drawn_at_cuts_.resize(actions_.rows(), static_cast<Eigen::Index>(cuts_.size()));
  RETURN_IF_ERROR(runner_.Act(policy, options_.mode, cut_observations_, cut_masks_, rng_, drawn_at_cuts_));
  cut_actions_(Eigen::all, cuts_) = drawn_at_cuts_;
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
  if (returns_.has_value()) {
    RETURN_IF_ERROR(returns_->Add(i, transition, {advantages_[i], next_values_[i], critic_version}, end));
  } else if (next_actions_.has_value()) {
    RETURN_IF_ERROR(
        next_actions_->Add(i, transition, {advantages_[i], critic_version}, end, Column(cut_actions_, i)));
  } else {
    RETURN_IF_ERROR(n_step_->Add(i, transition, {advantages_[i], critic_version}, end));
  }
  ++counters_.transitions;
  if (end.has_value()) ++counters_.episodes;
  if (result.broken) ++counters_.broken;
  return absl::OkStatus();
}

}  // namespace dbr
