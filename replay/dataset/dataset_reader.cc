#include "replay/dataset/dataset_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/types/span.h"
#include "core/status_macros.h"
#include "replay/dataset/hdf5_file.h"
#include "replay/dataset/minari_metadata.h"
#include "replay/dataset/step_source.h"

namespace dbr {
namespace {

constexpr int kDefaultMaxEpisodeSteps = 1000;

// The episode being read.
struct OpenEpisode {
  double episode_return = 0;
  int length = 0;
  bool spoiled = false;  // by a row with a value that is not finite
  bool gap = true;       // the step before the next one was not handed out
};

// The layout that the file names: by an attribute, or as Minari's own.
absl::StatusOr<std::optional<DatasetLayout>> OwnLayout(const Hdf5File& file, const MinariMetadata& metadata) {
  const std::optional<std::string> attribute = file.Text("layout");
  if (!attribute.has_value()) {
    return metadata.is_minari ? std::make_optional(DatasetLayout::kMinari) : std::nullopt;
  }
  const absl::StatusOr<DatasetLayout> own = ParseDatasetLayout(*attribute);
  if (own.ok()) return *own;
  return absl::InvalidArgumentError(
      absl::StrCat(file.path(), ": attribute 'layout': ", own.status().message()));
}

absl::StatusOr<DatasetLayout> LayoutOf(const Hdf5File& file, const MinariMetadata& metadata,
                                       const DatasetOptions& options) {
  ASSIGN_OR_RETURN(const std::optional<DatasetLayout> own, OwnLayout(file, metadata));
  if (!own.has_value() && !options.layout.has_value()) {
    return absl::InvalidArgumentError(absl::StrCat(
        file.path(), ": expected a named layout, found no attribute 'layout' in the file; name it: ",
        "d4rl, d4rl_pybullet or minari (the first two have the same keys and differ by one row, so "
        "that a guess could train on rewards of other actions)"));
  }
  if (!own.has_value()) return *options.layout;
  if (options.layout.has_value() && *options.layout != *own) {
    return absl::InvalidArgumentError(absl::StrCat(
        file.path(), ": expected layout ", DatasetLayoutName(*options.layout),
        ", as named, found a file that says ", DatasetLayoutName(*own), "; name that one, or none"));
  }
  return *own;
}

absl::StatusOr<std::unique_ptr<StepSource>> OpenSteps(const Hdf5File& file, DatasetLayout layout,
                                                      const StepSourceOptions& options) {
  switch (layout) {
    case DatasetLayout::kD4rl:
      return OpenD4rlSteps(file, options);
    case DatasetLayout::kD4rlPybullet:
      return OpenPybulletSteps(file, options);
    case DatasetLayout::kMinari:
      return OpenMinariSteps(file, options);
  }
  return absl::InvalidArgumentError("unknown layout");
}

absl::Status CheckSizes(const Hdf5File& file, const StepSource& steps, const DatasetOptions& options) {
  const bool observations_fit =
      options.observation_size == 0 || options.observation_size == steps.observation_size();
  const bool actions_fit = options.action_width == 0 || options.action_width == steps.action_width();
  if (observations_fit && actions_fit) return absl::OkStatus();
  const std::optional<std::string> env = file.Text("env");
  return absl::InvalidArgumentError(absl::StrCat(
      file.path(), ": expected observations of ", options.observation_size, " and actions of ",
      options.action_width, " numbers", options.env.empty() ? "" : absl::StrCat(" (", options.env, ")"),
      ", found ", steps.observation_size(), " and ", steps.action_width(),
      env.has_value() ? absl::StrCat(" (", *env, ")") : "", "; the file holds data of another environment"));
}

}  // namespace

struct DatasetReader::State {
  Hdf5File file;
  DatasetOptions options;  // what was left open is filled in
  std::string env;
  TransitionLayout layout;
  std::unique_ptr<StepSource> source;
  std::string action_space;  // that the file names; empty: none

  absl::Span<const Step> steps;  // read
  std::size_t next = 0;          // of them to be handed out
  OpenEpisode episode;
  DatasetFacts facts;
  double squares = 0;  // sum of squared distances of returns from their mean (Welford 1962)
  std::int64_t returns = 0;
  absl::Status failure;

  StepSourceOptions SourceOptions(bool flags_only) const {
    return {.max_episode_steps = options.max_episode_steps,
            .flags_only = flags_only,
            .action_space = action_space,
            .cancelled = options.cancelled};
  }
  absl::StatusOr<absl::Span<const Step>> NextSteps(StepSource* from) const;
  absl::Status Refill();
  void TakeFaults();
  absl::Status RefuseBadRows();
  absl::Status Fill(TransitionChunk* chunk);
  void Take(const Step& step, TransitionChunk* chunk);
  void Write(const Step& step, TransitionChunk* chunk) const;
  void Mark(const Step& step, TransitionChunk* chunk) const;
  void CountEnd(bool terminal);
};

absl::StatusOr<absl::Span<const Step>> DatasetReader::State::NextSteps(StepSource* from) const {
  if (options.cancelled != nullptr && *options.cancelled)
    return absl::CancelledError(absl::StrCat(file.path(), ": the reading was stopped"));
  return from->NextSteps();
}

absl::Status DatasetReader::State::Refill() {
  ASSIGN_OR_RETURN(steps, NextSteps(source.get()));
  next = 0;
  TakeFaults();
  if (facts.bad_rows > 0 && !options.skip_bad_rows) return RefuseBadRows();
  return absl::OkStatus();
}

absl::Status DatasetReader::State::RefuseBadRows() {
  while (!steps.empty()) {
    ASSIGN_OR_RETURN(steps, NextSteps(source.get()));
  }
  TakeFaults();
  const RowFaults faults = source->faults();
  const std::string flags =
      faults.bad_flags == 0
          ? ""
          : absl::StrCat(" (in ", faults.bad_flags,
                         " of them a flag that is neither 0 nor 1, or that another flag contradicts)");
  return absl::InvalidArgumentError(absl::StrCat(
      file.path(), ": expected finite numbers",
      faults.bad_flags == 0 ? ", found NaN or infinity in " : " and flags of 0 or 1, found other values in ",
      faults.bad, " of ", facts.rows, " rows", flags, ", the first of them row ", faults.first_bad,
      " (counted from 0); repair the file, or leave such ", "rows out with --skip-bad-rows"));
}

void DatasetReader::State::TakeFaults() {
  const RowFaults faults = source->faults();
  facts.bad_rows = faults.bad;
  facts.bad_flags = faults.bad_flags;
  facts.actions_outside = faults.actions_outside;
}

absl::Status DatasetReader::State::Fill(TransitionChunk* chunk) {
  while (chunk->size < chunk->capacity) {
    if (next == steps.size()) {
      RETURN_IF_ERROR(Refill());
      if (steps.empty()) break;
    }
    Take(steps[next++], chunk);
  }
  return absl::OkStatus();
}

void DatasetReader::State::Take(const Step& step, TransitionChunk* chunk) {
  episode.episode_return += step.reward;
  ++episode.length;
  episode.spoiled = episode.spoiled || step.bad;
  if (step.has_next && !step.bad) {
    Write(step, chunk);
    chunk->starts.push_back(episode.gap);
    if (!episode.spoiled) Mark(step, chunk);
    ++chunk->size;
    ++facts.transitions;
    episode.gap = false;
  } else {
    episode.gap = true;
  }
  if (step.end == StepEnd::kNone) return;
  CountEnd(step.end == StepEnd::kTerminal);
  episode = {};
}

void DatasetReader::State::Write(const Step& step, TransitionChunk* chunk) const {
  const auto observation = static_cast<std::size_t>(layout.observation_width),
             action = static_cast<std::size_t>(layout.action_width);
  WriteRow({.observation = {step.observation, observation},
            .action = {step.action, action},
            .reward = step.reward,
            .discount = step.end == StepEnd::kTerminal ? 0 : options.discount,
            .next_observation = {step.next_observation, observation}},
           layout, chunk->row(chunk->size));
}

// The transition at chunk->size may be its episode's last.
void DatasetReader::State::Mark(const Step& step, TransitionChunk* chunk) const {
  if (step.end == StepEnd::kNone && !step.last_transition) return;
  EndedEpisode ended;
  ended.index = chunk->size;
  ended.terminal = step.end == StepEnd::kTerminal;
  ended.end.episode_return = static_cast<float>(episode.episode_return + step.following_reward);
  ended.end.length = episode.length + (step.last_transition ? 1 : 0);
  chunk->ended.push_back(ended);
}

void DatasetReader::State::CountEnd(bool terminal) {
  ++facts.episodes;
  ++(terminal ? facts.terminals : facts.timeouts);
  if (episode.spoiled) return;
  const double value = episode.episode_return;
  facts.returns.push_back(static_cast<float>(value));
  if (returns++ == 0) facts.return_mean = facts.return_min = facts.return_max = value;
  const double from_old_mean = value - facts.return_mean;
  facts.return_mean += from_old_mean / static_cast<double>(returns);
  squares += from_old_mean * (value - facts.return_mean);
  facts.return_std = std::sqrt(squares / static_cast<double>(returns));
  facts.return_min = std::min(facts.return_min, value);
  facts.return_max = std::max(facts.return_max, value);
}

absl::StatusOr<std::unique_ptr<DatasetReader>> DatasetReader::Open(const std::string& path,
                                                                   const DatasetOptions& options) {
  auto state = std::make_unique<State>();
  ASSIGN_OR_RETURN(const std::string file, FindDataFile(path));
  ASSIGN_OR_RETURN(state->file, Hdf5File::Open(file));
  state->options = options;
  ASSIGN_OR_RETURN(MinariMetadata metadata, ReadMinariMetadata(state->file));
  ASSIGN_OR_RETURN(state->options.layout, LayoutOf(state->file, metadata, options));
  state->action_space = std::move(metadata.action_space);
  state->env = state->file.Text("env").value_or("");
  if (options.max_episode_steps == 0) {
    const std::int64_t steps = state->file.Number("max_episode_steps").value_or(0);
    const bool said = steps > 0 && steps <= std::numeric_limits<int>::max();
    state->options.max_episode_steps = said ? static_cast<int>(steps) : kDefaultMaxEpisodeSteps;
  }
  ASSIGN_OR_RETURN(state->source, OpenSteps(state->file, *state->options.layout,
                                            state->SourceOptions(/*flags_only=*/false)));
  RETURN_IF_ERROR(CheckSizes(state->file, *state->source, options));
  state->layout = {.observation_width = state->source->observation_size(),
                   .action_width = state->source->action_width()};
  state->facts.rows = state->source->rows();
  return std::unique_ptr<DatasetReader>(new DatasetReader(std::move(state)));
}

DatasetReader::DatasetReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
DatasetReader::~DatasetReader() = default;

DatasetLayout DatasetReader::layout() const {
  return *state_->options.layout;
}
const TransitionLayout& DatasetReader::transition_layout() const {
  return state_->layout;
}
const std::string& DatasetReader::path() const {
  return state_->file.path();
}
const std::string& DatasetReader::env() const {
  return state_->env;
}
int DatasetReader::max_episode_steps() const {
  return state_->options.max_episode_steps;
}
const DatasetFacts& DatasetReader::facts() const {
  return state_->facts;
}

absl::StatusOr<int> DatasetReader::Next(TransitionChunk* chunk) {
  DBR_CHECK(chunk->layout == state_->layout);
  chunk->size = 0;
  chunk->starts.clear();
  chunk->ended.clear();
  RETURN_IF_ERROR(state_->failure);
  state_->failure = state_->Fill(chunk);
  RETURN_IF_ERROR(state_->failure);
  return chunk->size;
}

absl::StatusOr<std::int64_t> DatasetReader::CountTransitions() {
  ASSIGN_OR_RETURN(const std::unique_ptr<StepSource> source,
                   OpenSteps(state_->file, layout(), state_->SourceOptions(/*flags_only=*/true)));
  std::int64_t transitions = 0;
  while (true) {
    ASSIGN_OR_RETURN(const absl::Span<const Step> steps, state_->NextSteps(source.get()));
    if (steps.empty()) return transitions;
    for (const Step& step : steps) transitions += step.has_next;
  }
}

}  // namespace dbr
