#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "actor/evaluation_loop.h"
#include "actor/evaluator.h"
#include "actor/policy_fit.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/common_options.h"
#include "deploy/film/film.h"
#include "deploy/launch/result_tables.h"
#include "deploy/launch/results.h"
#include "deploy/manual/number_option.h"
#include "deploy/process/interrupt.h"
#include "deploy/terminal/terminal.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "nn/policy.h"

namespace dbr {
namespace {

struct EvaluateFlags {
  std::string policy;
  std::string which;
  std::string opponent;
  int episodes = 1000;
  std::uint64_t seed = 1;
  std::string mode = "mode";
  bool json = false;
  std::string film;
};

// The opponents of the environments that have any, as choices: "random, one_ply or mcts:N" reads as
// random|one_ply|mcts:N.
std::string OpponentNames() {
  std::vector<std::string> known;
  for (const std::string& env : EnvNames()) {
    const std::string& opponents = PresentationOf(env).opponents;
    if (!opponents.empty()) known.push_back(absl::StrReplaceAll(opponents, {{", ", "|"}, {" or ", "|"}}));
  }
  return absl::StrJoin(known, "|");
}

// Films the first episode of the evaluation with that seed.
absl::StatusOr<int> RunFilm(const EvaluateFlags& flags, const PolicyNetworks& policy, ActingMode mode) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv({.name = policy.spec().env, .opponents = {}}));
  RETURN_IF_ERROR(CheckPolicyFits(policy.spec(), env->spec()));
  const auto column = [](auto span) {
    return Eigen::Map<const MatrixX<float>>(span.data(), static_cast<Eigen::Index>(span.size()), 1);
  };
  PolicyRunner runner;
  Rng rng(flags.seed);
  const ChooseAction choose = [&](absl::Span<const float> observation, absl::Span<const float> mask,
                                  absl::Span<float> action) {
    Eigen::Map<MatrixX<float>> actions(action.data(), static_cast<Eigen::Index>(action.size()), 1);
    return runner.Act(policy, mode, column(observation), column(mask), rng, actions);
  };
  const Interrupt interrupt;
  const absl::StatusOr<FilmSummary> film =
      FilmEpisode(*env, choose, {.path = flags.film, .seed = flags.seed * kMaxEpisodes}, &interrupt.flag());
  if (absl::IsCancelled(film.status())) return kInterruptedExit;
  RETURN_IF_ERROR(film.status());
  std::printf("%s: %s steps on %s with a return of %.1f, %s frames, %s kB\n", flags.film.c_str(),
              WithCommas(film->steps).c_str(), env->spec().name.c_str(), film->episode_return,
              WithCommas(film->frames).c_str(), WithCommas((film->bytes + 999) / 1000).c_str());
  return 0;
}

absl::StatusOr<int> RunEvaluate(const EvaluateFlags& flags) {
  ASSIGN_OR_RETURN(const ActingMode mode, ParseActingMode(flags.mode));
  ASSIGN_OR_RETURN(const PlayedPolicy played, OpenNamedPolicy(flags.policy, flags.which));
  const std::shared_ptr<const PolicyNetworks>& policy = played.networks;
  if (!flags.film.empty()) return RunFilm(flags, *policy, mode);
  std::vector<std::string> opponents = {flags.opponent};
  if (flags.opponent.empty()) opponents = OpponentsToEvaluate(policy->spec().env, {});
  if (flags.json) opponents.resize(1);
  const Interrupt interrupt;
  const absl::StatusOr<std::vector<EvaluationResult>> results = EvaluateAgainst(
      *policy, opponents, {.opponent = "", .episodes = flags.episodes, .seed = flags.seed, .mode = mode},
      &interrupt.flag());
  if (absl::IsCancelled(results.status())) return kInterruptedExit;
  RETURN_IF_ERROR(results.status());
  if (flags.json) {
    nlohmann::ordered_json json = ToJson(results->front());
    json["policy"] = std::string(NameOf(played.choice));
    std::printf("%s\n", json.dump().c_str());
    return 0;
  }
  const PolicySnapshot& snapshot = policy->snapshot();
  std::printf("%s: %s on %s, policy %s (%s) after %s updates; seed %s, acting mode %s\n%s",
              flags.policy.c_str(), snapshot.spec.algorithm.c_str(), snapshot.spec.env.c_str(),
              WithCommas(snapshot.version).c_str(), std::string(NameOf(played.choice)).c_str(),
              WithCommas(snapshot.updates).c_str(), absl::StrCat(flags.seed).c_str(), flags.mode.c_str(),
              ResultTable(*results).c_str());
  return 0;
}

}  // namespace

void AddEvaluate(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<EvaluateFlags>();
  CLI::App* command = app->add_subcommand(
      "evaluate",
      "Play episodes with a policy and print its mean score and return with their standard errors");
  AddPolicyOption(command, &flags->policy);
  AddWhichOption(command, &flags->which);
  command
      ->add_option("--opponent", flags->opponent,
                   "The player that it meets [all that the environment has; with --json the first of them]")
      ->type_name(OpponentNames());
  command
      ->add_option("--episodes", flags->episodes,
                   "Episodes to play; against an opponent, games, of which it begins every second one")
      ->capture_default_str()
      ->transform(WholeNumber(1, 1 << 20))
      ->type_name("N");
  AddSeedOption(command, "Random seed: the same one plays the same games", &flags->seed);
  AddModeOption(command, "How the policy acts", &flags->mode);
  command->add_flag("--json", flags->json,
                    "Print one JSON object: {env, opponent, episodes, seed, score, return, policy}");
  command
      ->add_option("--film", flags->film,
                   "Play one episode of a robot alone, and film it into this animated WebP file")
      ->type_name("FILE")
      ->excludes("--json");
  command->footer(
      "Examples:\n"
      "  dbr evaluate --policy runs/quickstart\n"
      "  dbr evaluate --policy runs/quickstart/policy/latest.safetensors --opponent mcts:10 --episodes 2000 "
      "--json\n"
      "  dbr evaluate --policy runs/hopper --which best --film hopper.webp");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunEvaluate(*flags);
    *exit_code = result.ok() ? *result : Fail("evaluate", result.status());
  });
}

}  // namespace dbr
