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
#include "actor/evaluation_loop.h"
#include "actor/evaluator.h"
#include "core/status_macros.h"
#include "deploy/command_line.h"
#include "deploy/interrupt.h"
#include "deploy/result_tables.h"
#include "deploy/results.h"
#include "deploy/terminal.h"

namespace dbr {
namespace {

struct EvaluateFlags {
  std::string policy;
  std::string opponent;
  int episodes = 1000;
  std::uint64_t seed = 1;
  std::string mode = "mode";
  bool json = false;
};

absl::StatusOr<int> RunEvaluate(const EvaluateFlags& flags) {
  ASSIGN_OR_RETURN(const ActingMode mode, ParseActingMode(flags.mode));
  ASSIGN_OR_RETURN(const std::shared_ptr<const PolicyNetworks> policy, OpenPolicy(flags.policy));
  std::vector<std::string> opponents = {flags.opponent};
  if (flags.opponent.empty()) opponents = OpponentsToEvaluate(policy->spec().env, {});
  if (flags.json) opponents.resize(1);
  const Interrupt interrupt;
  std::vector<EvaluationResult> results;
  for (const std::string& opponent : opponents) {
    const EvaluationOptions options{
        .opponent = opponent, .episodes = flags.episodes, .seed = flags.seed, .mode = mode};
    absl::StatusOr<EvaluationResult> result = Evaluate(*policy, options, &interrupt.flag());
    if (absl::IsCancelled(result.status())) return kInterruptedExit;
    RETURN_IF_ERROR(result.status());
    results.push_back(*std::move(result));
  }
  if (flags.json) {
    std::printf("%s\n", ToJson(results[0]).dump().c_str());
    return 0;
  }
  const PolicySnapshot& snapshot = policy->snapshot();
  std::printf("%s: %s on %s, policy %s after %s updates; seed %s, acting mode %s\n%s", flags.policy.c_str(),
              snapshot.spec.algorithm.c_str(), snapshot.spec.env.c_str(),
              WithCommas(snapshot.version).c_str(), WithCommas(snapshot.updates).c_str(),
              absl::StrCat(flags.seed).c_str(), flags.mode.c_str(), ResultTable(results).c_str());
  return 0;
}

}  // namespace

void AddEvaluate(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<EvaluateFlags>();
  CLI::App* command =
      app->add_subcommand("evaluate", "Play games with a policy and give its score with the standard error");
  command->add_option("--policy", flags->policy, "A policy file, or a run folder for its newest one")
      ->required()
      ->type_name("FILE_OR_RUN");
  command
      ->add_option("--opponent", flags->opponent,
                   "random, one_ply or mcts:N [all that the environment has; with --json the first of them]")
      ->type_name("NAME");
  command
      ->add_option("--episodes", flags->episodes, "Games against each opponent, every second one begun by it")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 20));
  command->add_option("--seed", flags->seed, "The same seed plays the same games")
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--mode", flags->mode, "How the policy acts: sample, mode, greedy_q or support")
      ->capture_default_str()
      ->type_name("MODE");
  command->add_flag("--json", flags->json,
                    "Print one JSON object: {env, opponent, episodes, seed, score, return}");
  command->footer(
      "Examples:\n"
      "  dbr evaluate --policy runs/quickstart\n"
      "  dbr evaluate --policy runs/quickstart/policy/latest.safetensors --opponent mcts:10 --episodes 2000 "
      "--json");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunEvaluate(*flags);
    *exit_code = result.ok() ? *result : Fail("evaluate", result.status());
  });
}

}  // namespace dbr
