// A table with one line for each environment. It is a plain table because the linker would drop a registrar
// in a static archive.
#include "envs/registry/registry.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "envs/bullet/ant.h"
#include "envs/bullet/half_cheetah.h"
#include "envs/bullet/hopper.h"
#include "envs/bullet/locomotion.h"
#include "envs/bullet/walker2d.h"
#include "envs/connect4/env.h"
#include "envs/connect4/presentation.h"

namespace dbr {
namespace {

using Made = absl::StatusOr<std::unique_ptr<Env>>;

struct Entry {
  std::string name;
  std::vector<std::string> aliases;
  std::vector<std::string> evaluation_opponents;  // empty for an environment without opponents
  Made (*make)(absl::string_view name, const EnvOptions& options);
  EnvPresentation presentation = {};
};

// Makes an environment with the robot that `plan` makes. Robots take no opponents.
template <bullet::RobotPlan (*plan)()>
Made MakeRobot(absl::string_view name, const EnvOptions&) {
  return std::make_unique<bullet::LocomotionEnv>(std::string(name), plan());
}

Made MakeConnect4(absl::string_view, const EnvOptions& options) {
  return connect4::Connect4Env::Make(options.opponents, options.random_start_share);
}

const std::vector<Entry>& Entries() {
  static const auto* const entries = new std::vector<Entry>{
      {"ant", {"AntBulletEnv-v0"}, {}, MakeRobot<bullet::AntPlan>},
      {"connect4",
       {"connect_four"},
       {"random", "one_ply", "mcts:10", "mcts:100"},
       MakeConnect4,
       connect4::Presentation()},
      {"half_cheetah", {"HalfCheetahBulletEnv-v0"}, {}, MakeRobot<bullet::HalfCheetahPlan>},
      {"hopper", {"HopperBulletEnv-v0"}, {}, MakeRobot<bullet::HopperPlan>},
      {"walker2d", {"Walker2DBulletEnv-v0"}, {}, MakeRobot<bullet::Walker2dPlan>},
  };
  return *entries;
}

const Entry* Find(absl::string_view name) {
  for (const Entry& entry : Entries()) {
    if (name == entry.name || std::count(entry.aliases.begin(), entry.aliases.end(), name) > 0) return &entry;
  }
  return nullptr;
}

}  // namespace

EnvOptions TrainingEnv(const EnvConfig& config) {
  return {.name = config.name(),
          .opponents = {config.opponents().begin(), config.opponents().end()},
          .random_start_share = config.random_start_share()};
}

absl::StatusOr<std::unique_ptr<Env>> MakeEnv(const EnvOptions& options) {
  const Entry* const entry = Find(options.name);
  if (entry == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("unknown environment \"", options.name,
                                                   "\"; expected one of: ", absl::StrJoin(EnvNames(), ", ")));
  }
  if (entry->evaluation_opponents.empty() && !options.opponents.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("environment ", entry->name, " has no opponents, found \"",
                                                   absl::StrJoin(options.opponents, "\", \""),
                                                   "\"; leave the list of opponents empty"));
  }
  if (entry->evaluation_opponents.empty() && options.random_start_share > 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("environment ", entry->name, " has no random starts, which are for two-player games; ",
                     "expected env.random_start_share: 0, found ", options.random_start_share));
  }
  return entry->make(entry->name, options);
}

std::vector<std::string> EnvNames() {
  std::vector<std::string> names;
  for (const Entry& entry : Entries()) names.push_back(entry.name);
  std::sort(names.begin(), names.end());
  return names;
}

const EnvPresentation& PresentationOf(absl::string_view env_name) {
  static const auto* const unknown = new EnvPresentation();
  const Entry* const entry = Find(env_name);
  return entry == nullptr ? *unknown : entry->presentation;
}

std::vector<std::string> EvaluationOpponents(absl::string_view env_name) {
  const Entry* const entry = Find(env_name);
  return entry == nullptr ? std::vector<std::string>() : entry->evaluation_opponents;
}

}  // namespace dbr
