// The ways in which offline data lies in an HDF5 file.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// kD4rl: row t holds an observation, the action taken there, the reward that this action earned, and whether
// the task ended with it (`terminals`; where given also `next_observations`, and `timeouts` or
// `episode_terminals`, which marks the last row of every episode).
// kD4rlPybullet: row t holds an observation, the action taken there, and the reward and terminal flag
// received ON ARRIVING at this observation; an episode has one row more than steps, the last with a zero
// action. kMinari: a group for each episode, with one observation more than actions. The first two have the
// same keys and differ by one row, so that a layout is never guessed.
enum class DatasetLayout { kD4rl, kD4rlPybullet, kMinari };

// "d4rl", "d4rl_pybullet" or "minari". InvalidArgument, naming the three, for anything else.
absl::StatusOr<DatasetLayout> ParseDatasetLayout(absl::string_view name);

std::string DatasetLayoutName(DatasetLayout layout);

}  // namespace dbr
