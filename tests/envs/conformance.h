// The rules for every environment, of any kind: checks that conformance_test.cc runs over the whole registry.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/rng.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "gtest/gtest.h"

namespace dbr::conformance {

// An environment with guarded memory for its outputs, and an agent that acts at random.
class World {
 public:
  explicit World(const EnvOptions& options) : env_(MakeEnv(options).value()) {
    const EnvSpec& spec = env_->spec();
    observation_.assign(spec.observation_size + 2 * kGuard, kGuardValue);
    mask_.assign(spec.actions.mask_width() + 2 * kGuard, kGuardValue);
    action_.assign(spec.actions.width(), 0.0f);
  }

  void Reset(std::uint64_t seed) {
    Poison();
    env_->Reset(seed, observation(), mask());
  }

  // Draws a random legal action and takes it.
  StepResult Step(Rng& rng) {
    Draw(rng);
    return StepWith(action_);
  }
  StepResult StepWith(const std::vector<float>& action) {
    Poison();
    return env_->Step(action, observation(), mask());
  }

  const EnvSpec& spec() const { return env_->spec(); }
  absl::Span<float> observation() {
    return absl::MakeSpan(observation_).subspan(kGuard, spec().observation_size);
  }
  absl::Span<float> mask() { return absl::MakeSpan(mask_).subspan(kGuard, spec().actions.mask_width()); }
  const std::vector<float>& last_action() const { return action_; }
  std::vector<float> Seen() {
    std::vector<float> seen(observation().begin(), observation().end());
    seen.insert(seen.end(), mask().begin(), mask().end());
    return seen;
  }
  bool GuardsIntact() const { return Intact(observation_) && Intact(mask_); }
  int CountLegal() {
    int legal = 0;
    for (const float value : mask()) legal += value == 1.0f;
    return legal;
  }

 private:
  static constexpr int kGuard = 8;
  static constexpr float kGuardValue = 12345.0f;

  void Draw(Rng& rng) {
    if (!spec().actions.discrete()) {
      for (float& value : action_) value = static_cast<float>(2 * rng.Uniform() - 1);
      return;
    }
    int skip = static_cast<int>(rng.Below(static_cast<std::uint32_t>(CountLegal())));
    int choice = 0;
    while (mask()[choice] != 1.0f || skip-- > 0) ++choice;
    action_[0] = static_cast<float>(choice);
  }

  // Fills the memory with NaN, so that a float that is not written is not finite.
  void Poison() {
    for (float& value : observation()) value = std::numeric_limits<float>::quiet_NaN();
    for (float& value : mask()) value = std::numeric_limits<float>::quiet_NaN();
  }

  static bool Intact(const std::vector<float>& guarded) {
    for (int i = 0; i < kGuard; ++i) {
      if (guarded[i] != kGuardValue || guarded[guarded.size() - 1 - i] != kGuardValue) return false;
    }
    return true;
  }

  std::unique_ptr<Env> env_;
  std::vector<float> observation_;
  std::vector<float> mask_;
  std::vector<float> action_;
};

// The number of episodes that is enough to see everything. It is smaller where episodes are long.
inline std::uint64_t EnoughEpisodes(const EnvSpec& spec) {
  return spec.max_episode_steps > 100 ? 3 : 20;
}

// Everything that was seen in an episode of random actions.
struct Episode {
  std::vector<std::vector<float>> seen;  // observation and mask, one more than there are steps
  std::vector<std::vector<float>> actions;
  std::vector<StepResult> results;
};

inline Episode PlayEpisode(World& world, std::uint64_t seed) {
  Episode episode;
  Rng rng(seed ^ 0x5eedu);
  world.Reset(seed);
  episode.seen.push_back(world.Seen());
  do {
    episode.results.push_back(world.Step(rng));
    episode.actions.push_back(world.last_action());
    episode.seen.push_back(world.Seen());
  } while (!episode.results.back().done() && episode.results.size() <= world.spec().max_episode_steps);
  return episode;
}

inline void ExpectSameEpisode(const Episode& a, const Episode& b) {
  EXPECT_EQ(a.seen, b.seen);
  EXPECT_EQ(a.actions, b.actions);
  ASSERT_EQ(a.results.size(), b.results.size());
  for (std::size_t i = 0; i < a.results.size(); ++i) {
    EXPECT_EQ(a.results[i].reward, b.results[i].reward);
    EXPECT_EQ(a.results[i].score, b.results[i].score);
    EXPECT_EQ(a.results[i].terminated, b.results[i].terminated);
    EXPECT_EQ(a.results[i].truncated, b.results[i].truncated);
  }
}

// Expects that all values are written, finite and within their memory. Masks have zeros and ones, with a
// legal action while the episode runs.
inline void ExpectWellWritten(World& world, bool done) {
  EXPECT_TRUE(world.GuardsIntact());
  for (const float value : world.observation()) EXPECT_TRUE(std::isfinite(value));
  for (const float value : world.mask()) EXPECT_TRUE(value == 0.0f || value == 1.0f) << value;
  EXPECT_TRUE(done || !world.spec().actions.discrete() || world.CountLegal() > 0) << "no legal action";
}

// Expects a finite reward. A score may come only at the end, only where the spec has scores, and is one of
// the three values.
inline void ExpectSaneResult(const EnvSpec& spec, const StepResult& result) {
  EXPECT_TRUE(std::isfinite(result.reward));
  EXPECT_FALSE(result.terminated && result.truncated);
  if (!spec.has_score || !result.done()) {
    EXPECT_EQ(result.score, 0.0f);
  } else {
    EXPECT_TRUE(result.score == 0.0f || result.score == 0.5f || result.score == 1.0f) << result.score;
  }
}

}  // namespace dbr::conformance
