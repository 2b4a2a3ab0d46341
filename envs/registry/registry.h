// Makes environments by name. Thread-safe: pure functions.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "envs/env.h"
#include "envs/presentation.h"
#include "proto/config.pb.h"

namespace dbr {

// The options that an environment is made with.
struct EnvOptions {
  std::string name;
  // Each episode draws one of them. Empty means the environment's default. Only two-player games have
  // opponents.
  std::vector<std::string> opponents;
  // The share of episodes that begin in the middle, from 0 to 1. Only two-player games have such.
  double random_start_share = 0;
};

// The environment that actors train on.
EnvOptions TrainingEnv(const EnvConfig& config);

// Makes an environment by its name or alias. Returns InvalidArgument for an unknown environment or opponent,
// with the known names, and for opponents or random starts of an environment that has none.
absl::StatusOr<std::unique_ptr<Env>> MakeEnv(const EnvOptions& options);

// All names, sorted. The conformance suite tests each of them.
std::vector<std::string> EnvNames();

// What people are told of an environment, by its name or alias; the default one for an unknown name.
const EnvPresentation& PresentationOf(absl::string_view env_name);

// The opponents against which an environment is evaluated by default, for example random, one_ply, mcts:10,
// mcts:100. Empty where it has none.
std::vector<std::string> EvaluationOpponents(absl::string_view env_name);

}  // namespace dbr
