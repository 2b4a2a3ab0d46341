// A whole episode of offline data.
#pragma once

#include <vector>

#include "absl/types/span.h"

namespace dbr {

// kUnfinished: the data stops before the episode does.
enum class EpisodeEnding { kTerminal, kTimeLimit, kUnfinished };

// T >= 1 steps of one episode, as views into memory that the caller owns.
struct EpisodeView {
  absl::Span<const float> observations;  // [T + 1][observation size]
  absl::Span<const float> actions;       // [T][action width]
  absl::Span<const float> rewards;       // [T], each earned by the action of its row
  EpisodeEnding ending = EpisodeEnding::kTerminal;

  int steps() const { return static_cast<int>(rewards.size()); }
};

// An episode in memory of its own, which grows step by step: the first observation, then for each step its
// action, its reward and the observation that it led to. Thread-compatible.
struct EpisodeRows {
  std::vector<float> observations;
  std::vector<float> actions;
  std::vector<float> rewards;
  EpisodeEnding ending = EpisodeEnding::kUnfinished;

  void Clear() {
    observations.clear();
    actions.clear();
    rewards.clear();
    ending = EpisodeEnding::kUnfinished;
  }
  void AddObservation(absl::Span<const float> observation) {
    observations.insert(observations.end(), observation.begin(), observation.end());
  }
  void AddAction(absl::Span<const float> action, float reward) {
    actions.insert(actions.end(), action.begin(), action.end());
    rewards.push_back(reward);
  }

  int steps() const { return static_cast<int>(rewards.size()); }
  EpisodeView View() const { return {observations, actions, rewards, ending}; }
};

// The first `steps` of an episode that has more, as an unfinished one. Views into the same memory.
inline EpisodeView FirstSteps(const EpisodeView& episode, int steps) {
  const std::size_t all = episode.rewards.size(), first = static_cast<std::size_t>(steps);
  return {.observations = episode.observations.first(episode.observations.size() / (all + 1) * (first + 1)),
          .actions = episode.actions.first(episode.actions.size() / all * first),
          .rewards = episode.rewards.first(first),
          .ending = EpisodeEnding::kUnfinished};
}

}  // namespace dbr
