#include "deploy/record/store_episodes.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/run_folder.h"
#include "core/status_macros.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

// A writer, and the bytes of an observation in the store's memory.
using Place = std::pair<std::uint32_t, absl::string_view>;

class EpisodeLinker {
 public:
  EpisodeLinker(const TransitionStore& store, int max_episode_steps)
      : store_(store), layout_(store.layout()), max_episode_steps_(max_episode_steps) {}

  void Add(std::uint32_t slot) {
    const std::uint32_t writer = store_.labels(slot).writer;
    const float* const row = store_.row(slot);
    std::size_t index = episodes_.size();
    const auto open = open_.find(Place(writer, Bytes(row)));
    if (open != open_.end()) {
      index = open->second;
      open_.erase(open);
    } else {
      episodes_.emplace_back();
    }
    StoreEpisode& episode = episodes_[index];
    episode.slots.push_back(slot);
    if (row[layout_.discount_offset()] == 0) {
      episode.ending = EpisodeEnding::kTerminal;
    } else if (static_cast<int>(episode.slots.size()) == max_episode_steps_) {
      episode.ending = EpisodeEnding::kTimeLimit;
    } else {
      open_[Place(writer, Bytes(row + layout_.next_observation_offset()))] = index;
    }
  }

  std::vector<StoreEpisode> Take() { return std::move(episodes_); }

 private:
  absl::string_view Bytes(const float* observation) const {
    return {reinterpret_cast<const char*>(observation), sizeof(float) * layout_.observation_width};
  }

  const TransitionStore& store_;
  const TransitionLayout layout_;
  const int max_episode_steps_;
  std::vector<StoreEpisode> episodes_;
  absl::flat_hash_map<Place, std::size_t> open_;  // episodes that go on there
};

}  // namespace

std::vector<StoreEpisode> LinkEpisodes(const TransitionStore& store, int max_episode_steps) {
  EpisodeLinker linker(store, max_episode_steps);
  for (std::uint64_t rank = 0; rank < store.size(); ++rank) {
    const std::uint32_t slot = store.SlotOf(store.KeyAtRank(rank));
    if (store.labels(slot).source == Source::kOnline) linker.Add(slot);
  }
  return linker.Take();
}

EpisodeRows CopyEpisode(const TransitionStore& store, const StoreEpisode& episode, std::size_t steps) {
  const TransitionLayout& layout = store.layout();
  const std::size_t size = layout.observation_width, width = layout.action_width;
  EpisodeRows rows;
  for (std::size_t t = 0; t < steps; ++t) {
    const float* const row = store.row(episode.slots[t]);
    rows.AddObservation({row, size});
    rows.AddAction({row + layout.action_offset(), width}, row[layout.reward_offset()]);
    if (t + 1 == steps) rows.AddObservation({row + layout.next_observation_offset(), size});
  }
  if (steps == episode.slots.size()) rows.ending = episode.ending;
  return rows;
}

absl::StatusOr<RunStore> OpenRunStore(const std::string& run) {
  const RunFolder folder{run};
  for (const std::string& path : {folder.config(), folder.replay_store()}) {
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored)) continue;
    return absl::NotFoundError(
        absl::StrCat("--run: expected the folder of a run, with its config and replay store, ", "found no ",
                     path, "; name the folder that dbr launch printed"));
  }
  ASSIGN_OR_RETURN(const Config config, LoadConfig(folder.config()));
  if (config.algorithm().n_step() > 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--run: expected a run with algorithm.n_step: 1, found ", config.algorithm().n_step(), " in ",
        folder.config(), ", whose store has the sums of several rewards. Name another run, or play its ",
        "policy anew: --quality medium --policy ", run));
  }
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv(TrainingEnv(config.env())));
  RunStore opened{.env = env->spec(), .store = nullptr};
  ASSIGN_OR_RETURN(opened.store,
                   TransitionStore::Open(
                       {.path = folder.replay_store(),
                        .env = env->spec().name,
                        .layout = TransitionLayout::Of(env->spec(), OptionalColumnsOf(config.algorithm())),
                        .capacity = config.replay().capacity(),
                        .byte_budget = config.replay().byte_budget(),
                        .resume = true}));
  return opened;
}

}  // namespace dbr
