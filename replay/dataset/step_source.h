// The steps of a file, whatever its layout: what the reader of transitions takes from the readers of the
// layouts.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "replay/dataset/hdf5_file.h"
#include "replay/dataset/row_faults.h"

namespace dbr {

// Whether an episode ends with a step: not, because the task ended, or because it was cut.
enum class StepEnd : std::uint8_t { kNone, kTerminal, kCut };

// One step of an episode. Pointers are null where only the flags are read, and `next_observation` also where
// there is none.
struct Step {
  const float* observation = nullptr;
  const float* action = nullptr;
  const float* next_observation = nullptr;
  float reward = 0;
  StepEnd end = StepEnd::kNone;
  bool has_next = false;  // it is a transition
  bool bad = false;       // a row that it takes values from is bad (RowFaults)
  // The next step ends the episode without being a transition: this one is the episode's last transition.
  bool last_transition = false;
  float following_reward = 0;  // the next step's reward, where last_transition; else 0
};

struct StepSourceOptions {
  int max_episode_steps = 0;  // longer episodes are cut; as DatasetOptions
  bool flags_only = false;    // reads neither observations nor actions nor rewards
  // minari: the space of the file's actions, as ActionScale::FromSpace takes it; empty: [-1, 1].
  std::string action_space = "";
  const std::atomic<bool>* cancelled = nullptr;  // as DatasetOptions

  absl::Status CheckGoesOn() const {
    if (cancelled == nullptr || !*cancelled) return absl::OkStatus();
    return absl::CancelledError("the reading was stopped");
  }
};

// A stream of a file's steps in its order. Thread-compatible.
class StepSource {
 public:
  virtual ~StepSource() = default;

  // Rows of the file, and the widths of its arrays.
  virtual std::int64_t rows() const = 0;
  virtual int observation_size() const = 0;
  virtual int action_width() const = 0;

  // The next steps, at least one; none at the end. They are valid until the next call. DataLoss where the
  // file cannot be read.
  virtual absl::StatusOr<absl::Span<const Step>> NextSteps() = 0;

  virtual RowFaults faults() const = 0;
};

// Each opens the steps of a layout. InvalidArgument where keys, shapes or lengths are not the layout's. The
// file is not owned and outlives the source.
absl::StatusOr<std::unique_ptr<StepSource>> OpenD4rlSteps(const Hdf5File& file,
                                                          const StepSourceOptions& options);
absl::StatusOr<std::unique_ptr<StepSource>> OpenPybulletSteps(const Hdf5File& file,
                                                              const StepSourceOptions& options);
absl::StatusOr<std::unique_ptr<StepSource>> OpenMinariSteps(const Hdf5File& file,
                                                            const StepSourceOptions& options);

}  // namespace dbr
