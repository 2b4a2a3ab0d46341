// Layout d4rl: a row is a step, and its reward is the one that its action earned.
#include <memory>
#include <utility>
#include <vector>

#include "core/status_macros.h"
#include "replay/dataset/row_window.h"
#include "replay/dataset/step_source.h"

namespace dbr {
namespace {

class D4rlSteps : public StepSource {
 public:
  D4rlSteps(FlatColumns columns, const StepSourceOptions& options)
      : options_(options), window_(std::move(columns), options.flags_only) {}

  std::int64_t rows() const override { return window_.columns().observations.rows(); }
  int observation_size() const override { return window_.columns().observations.width(); }
  int action_width() const override { return window_.columns().actions.width(); }
  RowFaults faults() const override { return window_.faults(); }

  absl::StatusOr<absl::Span<const Step>> NextSteps() override {
    steps_.clear();
    while (steps_.empty()) {
      ASSIGN_OR_RETURN(const bool more, window_.Advance());
      if (!more) break;
      // Without the row behind it the last one cannot be judged, unless it is the file's last.
      const int count = window_.rows() - (window_.at_end() ? 0 : 1);
      for (int i = 0; i < count; ++i) steps_.push_back(StepAt(i));
    }
    return absl::MakeConstSpan(steps_);
  }

 private:
  bool HasNextObservations() const { return window_.columns().next_observations.has_value(); }

  // How the step of row i ends, if it is number `number` of its episode, counted from 1. Without `timeouts`
  // an episode as long as the limit is cut by it, as D4RL's own reader has it.
  StepEnd EndOf(int i, int number) const {
    if (window_.terminal(i)) return StepEnd::kTerminal;
    const bool cut =
        window_.columns().timeouts.has_value() ? window_.timeout(i) : number == options_.max_episode_steps;
    return cut ? StepEnd::kCut : StepEnd::kNone;
  }

  Step StepAt(int i) {
    Step step{
        .observation = window_.observation(i), .action = window_.action(i), .reward = window_.reward(i)};
    step.end = EndOf(i, ++number_);
    step.bad = window_.bad(i);
    if (HasNextObservations()) {
      step.next_observation = window_.next_observation(i);
      step.has_next = true;
    } else {
      TakeNextRow(i, &step);
    }
    if (step.end != StepEnd::kNone) number_ = 0;
    return step;
  }

  // The next observation is the next row's, if this row's episode goes on there.
  void TakeNextRow(int i, Step* step) const {
    if (step->end == StepEnd::kTerminal) {  // discount 0: any will do
      step->next_observation = step->observation;
      step->has_next = true;
    } else if (step->end == StepEnd::kNone && i + 1 < window_.rows()) {
      step->next_observation = window_.observation(i + 1);
      step->has_next = true;
      step->bad = step->bad || window_.bad(i + 1);
      step->last_transition = EndOf(i + 1, number_ + 1) == StepEnd::kCut;
      step->following_reward = window_.reward(i + 1);
    }
  }

  const StepSourceOptions options_;
  RowWindow window_;
  std::vector<Step> steps_;
  int number_ = 0;  // steps of the episode so far
};

}  // namespace

absl::StatusOr<std::unique_ptr<StepSource>> OpenD4rlSteps(const Hdf5File& file,
                                                          const StepSourceOptions& options) {
  ASSIGN_OR_RETURN(FlatColumns columns, FlatColumns::Open(file, /*with_next_observations=*/true));
  return std::make_unique<D4rlSteps>(std::move(columns), options);
}

}  // namespace dbr
