// Adds Monte-Carlo returns to transitions, between the step loop and its sink.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "actor/transition_sink.h"
#include "core/transition.h"

namespace dbr {

struct ReturnOptions {
  double reward_scale = 1;  // the critics learn the values of reward_scale * r
  double discount = 0.99;   // the task's discount, for a cut episode without a critic
};

// What is known about a transition when it is taken.
struct TransitionValue {
  float value = 0;       // V(s), in the critics' units; NaN: there is no critic
  float next_value = 0;  // V(s'), where the transition cuts its episode
  std::uint64_t critic_version = 0;
};

// Holds the transitions of an episode back until it ends, because only then are their returns known. It then
// passes them on in order, each with its return R and the advantage reward_scale * R - V(s) (Oh et al. 2018,
// "Self-Imitation Learning", equation 1). V(s) comes from the critic at the time of that step. R is in the
// environment's units. Where the episode was cut, R continues with V(s') / reward_scale. Where there is no
// critic for that, it continues with the mean of the last rewards (StationaryContinuation). Holds at most one
// episode of each environment: max_episode_steps transitions. One thread at a time.
class EpisodeReturns {
 public:
  // `layout` must have a return. Environments have the numbers 0 to envs - 1.
  EpisodeReturns(const TransitionLayout& layout, int envs, const ReturnOptions& options, TransitionSink sink);

  // Takes the next transition of environment `env`. It does not read the transition's own return. With `end`
  // it passes the episode to the sink: it blocks as the sink does and returns the sink's first error. The
  // rest of the episode is then dropped.
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
  // The value that the return continues with after the episode's last transition, in the environment's units.
  double ValueBehind(const Episode& episode, float next_value) const;

  const TransitionLayout layout_;
  const ReturnOptions options_;
  const TransitionSink sink_;
  std::vector<Episode> episodes_;  // [envs]
  std::uint64_t held_ = 0;
};

}  // namespace dbr
