// The locomotion task as an environment.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "envs/bullet/locomotion_task.h"
#include "envs/env.h"

namespace dbr::bullet {

// Owns the task. One thread at a time. The observation is that of locomotion_task.h; the actions are one
// value in [-1, 1] for each hinge. The random seed of an episode draws the hinges' angles at its start, each
// uniform in [-0.1, 0.1] rad. A fall terminates the episode where the plan says so. After 1,000 steps it is
// truncated. It is truncated as `broken` where the simulation or the action has values that are not finite.
class LocomotionEnv : public Env {
 public:
  static constexpr int kMaxEpisodeSteps = 1000;

  LocomotionEnv(std::string name, RobotPlan plan);

  const EnvSpec& spec() const override { return spec_; }
  void Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float> mask) override;
  StepResult Step(absl::Span<const float> action, absl::Span<float> observation,
                  absl::Span<float> mask) override;
  bool GetFigure(Figure* figure) const override;

 private:
  StepResult Break(absl::Span<float> observation);

  const RobotPlan plan_;
  std::unique_ptr<LocomotionTask> task_;
  EnvSpec spec_;
  std::vector<float> last_observation_;
  int steps_left_ = 0;   // steps left in the episode; 0: no episode is running
  bool broken_ = false;  // the world must be made again
};

}  // namespace dbr::bullet
