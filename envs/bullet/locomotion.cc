#include "envs/bullet/locomotion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/check.h"

namespace dbr::bullet {
namespace {

bool AllFinite(absl::Span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

}  // namespace

LocomotionEnv::LocomotionEnv(std::string name, RobotPlan plan)
    : plan_(std::move(plan)), task_(std::make_unique<LocomotionTask>(plan_)) {
  spec_ = {.name = std::move(name),
           .observation_size = task_->observation_size(),
           .actions = {ActionKind::kContinuous, task_->num_actions()},
           .max_episode_steps = kMaxEpisodeSteps};
  last_observation_.resize(spec_.observation_size);
}

void LocomotionEnv::Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float>) {
  if (broken_) task_ = std::make_unique<LocomotionTask>(plan_);
  broken_ = false;
  task_->Begin(DrawStart(task_->num_actions(), seed), observation);
  std::copy(observation.begin(), observation.end(), last_observation_.begin());
  steps_left_ = kMaxEpisodeSteps;
}

StepResult LocomotionEnv::Step(absl::Span<const float> action, absl::Span<float> observation,
                               absl::Span<float>) {
  DBR_CHECK(steps_left_ > 0);  // requires Reset
  if (!AllFinite(action)) return Break(observation);
  const Progress progress = task_->Advance(action, observation);
  if (!progress.finite) return Break(observation);
  std::copy(observation.begin(), observation.end(), last_observation_.begin());
  --steps_left_;
  StepResult result;
  result.reward = static_cast<float>(progress.reward);
  result.terminated = progress.fallen;
  result.truncated = steps_left_ == 0 && !progress.fallen;
  if (result.done()) steps_left_ = 0;
  return result;
}

// A world that breaks is the simulation's error and says nothing about the value of the state. So the episode
// is truncated, not terminated, at the last finite observation, and the reward is 0.
StepResult LocomotionEnv::Break(absl::Span<float> observation) {
  std::copy(last_observation_.begin(), last_observation_.end(), observation.begin());
  broken_ = true;
  steps_left_ = 0;
  StepResult result;
  result.truncated = true;
  result.broken = true;
  return result;
}

bool LocomotionEnv::GetFigure(Figure* figure) const {
  task_->GetFigure(figure);
  return true;
}

}  // namespace dbr::bullet
