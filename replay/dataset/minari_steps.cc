// Layout minari: groups episode_0, episode_1, ... with observations [T + 1], actions, rewards, terminations
// and truncations [T].
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "core/status_macros.h"
#include "replay/dataset/action_scale.h"
#include "replay/dataset/end_keys.h"
#include "replay/dataset/row_window.h"
#include "replay/dataset/step_source.h"

namespace dbr {
namespace {

constexpr absl::string_view kPrefix = "episode_";
constexpr const char* kArrays[] = {"observations", "actions", "rewards", "terminations", "truncations"};

struct EpisodeColumns {
  Hdf5Column observations, actions, rewards, terminations, truncations;

  std::int64_t steps() const { return rewards.rows(); }
};

// A group that holds an episode. Its name may have zeros before the number.
struct EpisodeGroup {
  std::int64_t number = 0;
  std::string name;

  bool operator<(const EpisodeGroup& other) const {
    return std::tie(number, name) < std::tie(other.number, other.name);
  }
};

absl::Status CheckKeys(const Hdf5File& file, const std::string& group) {
  RETURN_IF_ERROR(CheckEndKeys(file, group, {"terminations", "truncations"}));
  std::vector<std::string> missing;
  for (const char* const array : kArrays) {
    if (!file.Has(absl::StrCat(group, "/", array))) missing.push_back(absl::StrCat("'", array, "'"));
  }
  if (missing.empty()) return absl::OkStatus();
  if (missing.size() == std::size(kArrays)) RETURN_IF_ERROR(file.CheckGroup(group));
  return absl::InvalidArgumentError(absl::StrCat(file.path(), ": expected group '", group, "' to have ",
                                                 absl::StrJoin(kArrays, ", "), ", found no ",
                                                 absl::StrJoin(missing, ", ")));
}

absl::StatusOr<EpisodeColumns> OpenEpisode(const Hdf5File& file, const std::string& group) {
  RETURN_IF_ERROR(CheckKeys(file, group));
  EpisodeColumns columns;
  Hdf5Column* const all[] = {&columns.observations, &columns.actions, &columns.rewards, &columns.terminations,
                             &columns.truncations};
  for (std::size_t i = 0; i < std::size(all); ++i) {
    ASSIGN_OR_RETURN(*all[i], file.Column(absl::StrCat(group, "/", kArrays[i])));
    const std::int64_t expected = i == 0 ? all[0]->rows() : all[0]->rows() - 1;
    if (all[i]->rows() != expected) {
      return absl::InvalidArgumentError(absl::StrCat(
          file.path(), ": expected one row more of observations than of the others in '", group, "', found ",
          all[0]->rows(), " of 'observations' and ", all[i]->rows(), " of '", kArrays[i], "'"));
    }
    if (i >= 2 && all[i]->width() != 1) {
      return absl::InvalidArgumentError(absl::StrCat(file.path(), ": expected one number a row in '",
                                                     all[i]->name(), "', found ", all[i]->width()));
    }
  }
  return columns;
}

class MinariSteps : public StepSource {
 public:
  MinariSteps(const Hdf5File& file, bool flags_only, std::vector<EpisodeGroup> episodes)
      : file_(file), flags_only_(flags_only), episodes_(std::move(episodes)) {}

  absl::Status Open(const StepSourceOptions& options) {
    for (const EpisodeGroup& episode : episodes_) {
      RETURN_IF_ERROR(options.CheckGoesOn());
      RETURN_IF_ERROR(CheckKeys(file_, episode.name));
      ASSIGN_OR_RETURN(const Hdf5Column rewards, file_.Column(absl::StrCat(episode.name, "/rewards")));
      rows_ += rewards.rows();
    }
    ASSIGN_OR_RETURN(const EpisodeColumns first, OpenEpisode(file_, episodes_[0].name));
    observation_size_ = first.observations.width();
    action_width_ = first.actions.width();
    if (options.action_space.empty()) return absl::OkStatus();
    ASSIGN_OR_RETURN(action_scale_,
                     ActionScale::FromSpace(options.action_space, action_width_, file_.path()));
    return absl::OkStatus();
  }

  std::int64_t rows() const override { return rows_; }
  int observation_size() const override { return observation_size_; }
  int action_width() const override { return action_width_; }
  RowFaults faults() const override { return faults_; }

  absl::StatusOr<absl::Span<const Step>> NextSteps() override {
    steps_.clear();
    while (steps_.empty()) {
      if (columns_.has_value() && next_step_ == columns_->steps()) columns_.reset();
      if (!columns_.has_value()) {
        if (next_episode_ == episodes_.size()) break;
        RETURN_IF_ERROR(Enter(episodes_[next_episode_++].name));
      }
      const int count =
          static_cast<int>(std::min<std::int64_t>(columns_->steps() - next_step_, RowWindow::kStretch));
      if (count > 0) RETURN_IF_ERROR(ReadSteps(count));
    }
    return absl::MakeConstSpan(steps_);
  }

 private:
  absl::Status Enter(const std::string& group) {
    ASSIGN_OR_RETURN(columns_, OpenEpisode(file_, group));
    next_step_ = 0;
    if (columns_->observations.width() == observation_size_ && columns_->actions.width() == action_width_) {
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(
        absl::StrCat(file_.path(), ": expected observations of ", observation_size_, " and actions of ",
                     action_width_, " numbers in all episodes, found ", columns_->observations.width(),
                     " and ", columns_->actions.width(), " in '", group, "'"));
  }

  absl::Status ReadSteps(int count) {
    terminations_.resize(count);
    truncations_.resize(count);
    RETURN_IF_ERROR(columns_->terminations.ReadFlags(next_step_, count, terminations_.data()));
    RETURN_IF_ERROR(columns_->truncations.ReadFlags(next_step_, count, truncations_.data()));
    marks_.assign(count + 1, 0);
    MarkBadFlags(absl::MakeSpan(terminations_), marks_.data());
    MarkBadFlags(absl::MakeSpan(truncations_), marks_.data());
    if (!flags_only_) {
      RETURN_IF_ERROR(ReadFloats(columns_->observations, count + 1, &observations_));
      RETURN_IF_ERROR(ReadFloats(columns_->actions, count, &actions_));
      action_scale_.Apply(absl::MakeSpan(actions_));
      RETURN_IF_ERROR(ReadFloats(columns_->rewards, count, &rewards_));
    }
    const bool last = next_step_ + count == columns_->steps();
    for (int i = 0; i < count; ++i) steps_.push_back(StepAt(i, last && i + 1 == count));
    CountBadRows(count, last);
    next_step_ += count;
    first_row_ += count;
    return absl::OkStatus();
  }

  absl::Status ReadFloats(const Hdf5Column& column, int count, std::vector<float>* values) {
    values->resize(std::size_t{1} * count * column.width());
    RETURN_IF_ERROR(column.ReadFloats(next_step_, count, values->data()));
    MarkNotFinite(*values, column.width(), &marks_);
    return absl::OkStatus();
  }

  Step StepAt(int i, bool last) const {
    Step step{.has_next = true, .bad = marks_[i] != 0 || marks_[i + 1] != 0};
    if (terminations_[i]) {
      step.end = StepEnd::kTerminal;
    } else if (truncations_[i] || last) {  // where a group ends, its episode does
      step.end = StepEnd::kCut;
    }
    if (flags_only_) return step;
    step.observation = observations_.data() + std::size_t{1} * i * observation_size_;
    step.next_observation = step.observation + observation_size_;
    step.action = actions_.data() + std::size_t{1} * i * action_width_;
    step.reward = rewards_[i];
    return step;
  }

  // The observation behind the last step belongs to that step's row.
  void CountBadRows(int count, bool last) {
    if (last) marks_[count - 1] |= marks_[count];
    CountMarks(absl::MakeConstSpan(marks_).first(count), first_row_, &faults_);
    if (!flags_only_) faults_.actions_outside += CountOutside(actions_, action_width_, marks_.data());
  }

  const Hdf5File& file_;
  const bool flags_only_;
  const std::vector<EpisodeGroup> episodes_;  // by rising number; at least one
  std::int64_t rows_ = 0;
  int observation_size_ = 0;
  int action_width_ = 0;
  ActionScale action_scale_;

  std::optional<EpisodeColumns> columns_;  // of the episode being read
  std::size_t next_episode_ = 0;           // index in episodes_
  std::int64_t next_step_ = 0;             // of the episode being read
  std::int64_t first_row_ = 0;             // of the file, counting steps: the row of next_step_
  std::vector<float> observations_, actions_, rewards_;
  std::vector<std::uint8_t> terminations_, truncations_, marks_;
  std::vector<Step> steps_;
  RowFaults faults_;
};

// The groups of episodes, by rising number. InvalidArgument for a name that ends in something else, for it
// would be passed over.
absl::StatusOr<std::vector<EpisodeGroup>> FindEpisodes(const Hdf5File& file) {
  std::vector<EpisodeGroup> episodes;
  for (const std::string& key : file.Keys()) {
    absl::string_view number = key;
    if (!absl::ConsumePrefix(&number, kPrefix)) continue;
    EpisodeGroup episode{.name = key};
    if (!absl::SimpleAtoi(number, &episode.number)) {
      return absl::InvalidArgumentError(absl::StrCat(
          file.path(), ": expected the number of an episode behind episode_, found '", key, "'; rename it"));
    }
    episodes.push_back(std::move(episode));
  }
  std::sort(episodes.begin(), episodes.end());
  return episodes;
}

}  // namespace

absl::StatusOr<std::unique_ptr<StepSource>> OpenMinariSteps(const Hdf5File& file,
                                                            const StepSourceOptions& options) {
  ASSIGN_OR_RETURN(std::vector<EpisodeGroup> episodes, FindEpisodes(file));
  if (episodes.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file.path(), ": expected groups episode_0, episode_1, ..., found ",
                     file.Keys().empty() ? "nothing" : absl::StrJoin(file.Keys(), ", "),
                     "; is the file of another layout?"));
  }
  auto steps = std::make_unique<MinariSteps>(file, options.flags_only, std::move(episodes));
  RETURN_IF_ERROR(steps->Open(options));
  return steps;
}

}  // namespace dbr
