// A tiny environment for the tests of this folder. It can be cut at a time limit, which Connect-4 never is.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "actor/vector_env.h"
#include "core/check.h"
#include "envs/env.h"

namespace dbr {

// Walks along a line for (random seed % 4) + 2 steps. An even random seed ends at a true terminal; an odd one
// is cut there, as broken where seed % 4 is 3. Observation: {seed % 1000, steps so far}. Action k of three is
// illegal where steps % 3 == k. The reward is steps so far + action / 10.
class LineEnv : public Env {
 public:
  const EnvSpec& spec() const override { return spec_; }

  void Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float> mask) override {
    seed_ = seed;
    steps_ = 0;
    Write(observation, mask);
  }

  StepResult Step(absl::Span<const float> action, absl::Span<float> observation,
                  absl::Span<float> mask) override {
    const int choice = static_cast<int>(action[0]);
    DBR_CHECK(choice >= 0 && choice < 3 && choice != steps_ % 3);
    StepResult result;
    result.reward = static_cast<float>(steps_) + action[0] / 10;
    ++steps_;
    Write(observation, mask);
    if (steps_ == LengthOf(seed_)) (IsCut(seed_) ? result.truncated : result.terminated) = true;
    result.broken = result.truncated && Breaks(seed_);
    return result;
  }

  static int LengthOf(std::uint64_t seed) { return static_cast<int>(seed % 4) + 2; }
  static bool IsCut(std::uint64_t seed) { return seed % 2 == 1; }
  static bool Breaks(std::uint64_t seed) { return seed % 4 == 3; }

 private:
  void Write(absl::Span<float> observation, absl::Span<float> mask) const {
    observation[0] = static_cast<float>(seed_ % 1000);
    observation[1] = static_cast<float>(steps_);
    for (int k = 0; k < 3; ++k) mask[k] = k == steps_ % 3 ? 0.0f : 1.0f;
  }

  const EnvSpec spec_{.name = "line",
                      .observation_size = 2,
                      .actions = {ActionKind::kDiscrete, 3},
                      .max_episode_steps = 5,
                      .has_score = false};
  std::uint64_t seed_ = 0;
  int steps_ = 0;
};

inline std::unique_ptr<VectorEnv> MakeLines(int count) {
  std::vector<std::unique_ptr<Env>> envs;
  for (int i = 0; i < count; ++i) envs.push_back(std::make_unique<LineEnv>());
  return std::make_unique<VectorEnv>(std::move(envs));
}

}  // namespace dbr
