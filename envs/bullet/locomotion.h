// The locomotion task as an environment.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "envs/bullet/locomotion_task.h"
#include "envs/env.h"

namespace dbr::bullet {

// Observation as in locomotion_task.h, actions [-1, 1] for each hinge. The seed of an episode draws the
// hinges' angles at its start, each uniform in [-0.1, 0.1] rad. An episode is terminated by a fall where the
// plan says so, truncated after 1,000 steps, and truncated as `broken` where the simulation gives values that
// are not finite.
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
  int steps_left_ = 0;   // of the episode; 0: none is running
  bool broken_ = false;  // the world has to be made anew
};

}  // namespace dbr::bullet
