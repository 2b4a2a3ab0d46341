// Layout d4rl_pybullet: a row's reward and terminal flag came with its observation, so that a step takes them
// from the row behind its own. The last row of an episode starts no step.
#include <memory>
#include <utility>
#include <vector>

#include "core/status_macros.h"
#include "replay/dataset/row_window.h"
#include "replay/dataset/step_source.h"

namespace dbr {
namespace {

class PybulletSteps : public StepSource {
 public:
  PybulletSteps(FlatColumns columns, const StepSourceOptions& options)
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
      for (int i = 0; i + 1 < window_.rows(); ++i) {
        if (!Ends(i)) steps_.push_back(StepAt(i));
      }
    }
    return absl::MakeConstSpan(steps_);
  }

 private:
  // Whether row i is the last of its episode. A file written here says by `timeouts` which ends are cuts.
  bool Ends(int i) const { return window_.terminal(i) || window_.timeout(i); }

  Step StepAt(int i) {
    Step step{.observation = window_.observation(i),
              .action = window_.action(i),
              .next_observation = window_.observation(i + 1),
              .reward = window_.reward(i + 1),
              .has_next = true,
              .bad = window_.bad(i) || window_.bad(i + 1)};
    ++number_;
    if (Ends(i + 1)) {
      const bool cut = window_.timeout(i + 1) || number_ == options_.max_episode_steps;
      step.end = cut ? StepEnd::kCut : StepEnd::kTerminal;
      number_ = 0;
    }
    return step;
  }

  const StepSourceOptions options_;
  RowWindow window_;
  std::vector<Step> steps_;
  int number_ = 0;  // steps of the episode so far
};

}  // namespace

absl::StatusOr<std::unique_ptr<StepSource>> OpenPybulletSteps(const Hdf5File& file,
                                                              const StepSourceOptions& options) {
  ASSIGN_OR_RETURN(FlatColumns columns, FlatColumns::Open(file, /*with_next_observations=*/false));
  return std::make_unique<PybulletSteps>(std::move(columns), options);
}

}  // namespace dbr
