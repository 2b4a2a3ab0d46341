// What a launch is going to do: its config, its folder, its processes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/run_folder.h"
#include "core/space.h"
#include "deploy/launch/folder_claim.h"
#include "deploy/process/supervisor.h"
#include "proto/config.pb.h"

namespace dbr {

struct LaunchOptions {
  std::string config = {};                  // a file; empty with `resume`: the run folder's own
  std::vector<std::string> overrides = {};  // path=value
  std::string run_dir = {};                 // empty: runs/ENV-ALGORITHM-DATE-TIME
  std::string seed_buffer = {};             // replay.seed_buffer.path, unless empty
  std::string seed_layout = {};             // replay.seed_buffer.layout, unless empty
  bool skip_bad_rows = false;               // sets replay.seed_buffer.skip_bad_rows
  bool resume = false;
};

struct RunPlan {
  Config config;
  std::string config_source;  // the file that the config came from
  RunFolder folder;
  bool resume = false;
  EnvSpec env;
  int actors = 1;  // 0: all training is offline
  std::string replay_address;
  std::string learner_address;
  std::unique_ptr<FolderClaim> claim;
};

// Loads and checks the config, makes the folder or checks that the run in it can be continued, claims it, and
// puts the effective config there. With `resume`, a folder whose run has nothing to go on with yet is begun
// anew; where there is something, nothing of it is changed before FolderClaim::Begin(). Errors:
// InvalidArgument for a bad config or seed buffer, for what does not fit the environment (CheckFits), and for
// a config that differs from the folder's where that would not continue the same run (each field is named);
// AlreadyExists where the folder is there and `resume` was not said; NotFound where there is nothing to
// resume; FailedPrecondition where another launch uses the folder.
absl::StatusOr<RunPlan> PrepareRun(const LaunchOptions& options, absl::Time now);

// Processes are stopped in this order: each saves its state while what it needs is still there.
enum StopRank { kStopActors, kStopLearner, kStopReplay };

// The processes of replay, learner and evaluator, in the order in which they start. `programs` is the folder
// of the programs.
std::vector<ProcessSpec> Services(const RunPlan& plan, const std::string& programs);
// The processes of the actors, which start after the offline phase.
std::vector<ProcessSpec> Actors(const RunPlan& plan, const std::string& programs);

// The environment that a config names. InvalidArgument where there is none.
absl::StatusOr<EnvSpec> EnvSpecOf(const Config& config);

// InvalidArgument where the algorithm does not serve the actions of `env` or wants a symmetry that `env` does
// not have, the way in which actors or the evaluator choose actions is not for them, or an evaluation has too
// many episodes or an opponent that `env` does not have.
absl::Status CheckFits(const Config& config, const EnvSpec& env);

// How many actor processes a launch of `config` starts on this machine; 0: all training is offline.
int ActorProcesses(const Config& config);

// How many actor processes a machine of `cores` gets by default: half of its cores, for the learner, the
// replay and the evaluator want the others.
int DefaultActors(int cores);

// The name of the algorithm's field in the config; "dbr" also where the config leaves the algorithm out.
std::string AlgorithmName(const Config& config);

}  // namespace dbr
