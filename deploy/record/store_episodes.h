// The episodes behind the transitions that a run's replay store holds.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "replay/dataset/episode.h"
#include "replay/store/transition_store.h"

namespace dbr {

// One episode, as slots of the store in their order.
struct StoreEpisode {
  std::vector<std::uint32_t> slots;
  EpisodeEnding ending = EpisodeEnding::kUnfinished;
};

// Finds the episodes in a store, in the order in which they began. Transitions of several environments lie in
// the store as they came: those of one writer are linked where the next observation of one is, bit for bit,
// the observation of a later one. An episode is over at discount 0 or after `max_episode_steps`. An episode
// is unfinished where its end was evicted or had not come when the run stopped. Rows of the seed buffer are
// left out.
std::vector<StoreEpisode> LinkEpisodes(const TransitionStore& store, int max_episode_steps);

// Copies the first `steps` steps of an episode. O(steps).
EpisodeRows CopyEpisode(const TransitionStore& store, const StoreEpisode& episode, std::size_t steps);

// A run's store, opened by the run's own config.
struct RunStore {
  EnvSpec env;
  std::unique_ptr<TransitionStore> store;
};

// Opens the store of the run in that folder. NotFound where it is no run folder or has no store,
// InvalidArgument where its transitions are of more than one step (algorithm.n_step), FailedPrecondition
// while the run goes on, and other errors of TransitionStore::Open.
absl::StatusOr<RunStore> OpenRunStore(const std::string& run);

}  // namespace dbr
