// Between the step loop and its sink, where transitions carry their Monte-Carlo returns.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "core/transition.h"

namespace dbr {

// Takes one transition, valid during the call, with its first advantage (kUnjudged where there is none), the
// version of the critic behind it, and how the episode went where this transition ended it.
using TransitionSink =
    std::function<absl::Status(const TransitionView& transition, float advantage,
                               std::uint64_t critic_version, const std::optional<EpisodeEnd>& end)>;

struct ReturnOptions {
  double reward_scale = 1;  // of the critics: they value reward_scale * r
  double discount = 0.99;   // of the task, for a cut episode without a critic
};

// What is known of a transition as it is taken.
struct TransitionValue {
  float value = 0;       // V(s), in the critics' units; NaN: there is no critic
  float next_value = 0;  // V(s'), where the transition cuts its episode
  std::uint64_t critic_version = 0;
};

// Holds the transitions of an episode back until it ends, for only then are their returns known; then passes
// them on one after another, each with R and with the advantage reward_scale * R - V(s) (Oh et al. 2018,
// "Self-Imitation Learning", equation 1), V(s) being that of the critic of its own step. R is in the
// environment's units; where the episode was cut it goes on with V(s') / reward_scale, and where there is no
// critic to say that, with the mean of the last rewards (StationaryContinuation). Holds at most an episode of
// each environment: max_episode_steps transitions. One thread at a time.
class EpisodeReturns {
 public:
  // `layout` has a return; environments are numbered from 0 to envs - 1.
  EpisodeReturns(const TransitionLayout& layout, int envs, const ReturnOptions& options, TransitionSink sink);

  // Takes the next transition of environment `env`, whose own return is not read. With `end` its episode goes
  // out: blocks as the sink does, and gives its first error; what had not gone out is dropped then.
  absl::Status Add(int env, const TransitionView& transition, const TransitionValue& value,
                   const std::optional<EpisodeEnd>& end);

  std::uint64_t held() const { return held_; }  // transitions

 private:
  struct Judgement {
    float value;
    std::uint64_t critic_version;
  };
  struct Episode {
    std::vector<float> rows;            // [T x stride]
    std::vector<Judgement> judgements;  // [T]
  };

  absl::Status PassOn(const Episode& episode, const EpisodeEnd& end);
  // What the return goes on with behind the episode's last transition, in the environment's units.
  double ValueBehind(const Episode& episode, float next_value) const;

  const TransitionLayout layout_;
  const ReturnOptions options_;
  const TransitionSink sink_;
  std::vector<Episode> episodes_;  // [envs]
  std::uint64_t held_ = 0;
};

}  // namespace dbr
