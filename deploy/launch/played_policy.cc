#include "deploy/launch/played_policy.h"

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/run_folder.h"
#include "core/status_macros.h"
#include "deploy/launch/run_access.h"
#include "nn/policy_choice.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

bool IsRun(const std::string& file_or_run) {
  std::error_code ignored;
  return std::filesystem::is_directory(file_or_run, ignored);
}

absl::StatusOr<PlayedPolicy> OpenBest(const std::string& run) {
  if (!IsRun(run)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--which best: expected a run folder, which keeps the policy of its best evaluation, "
                     "found '",
                     run, "'. Name the run's folder, or leave out --which best to play that file"));
  }
  const std::string path = RunFolder{run}.best_policy();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) {
    return absl::NotFoundError(
        absl::StrCat("'", run,
                     "' has no policy/best.safetensors: expected a run folder whose evaluator has "
                     "evaluated a policy. Use --which raw or --which average for its newest policy"));
  }
  ASSIGN_OR_RETURN(std::shared_ptr<const PolicyNetworks> policy, OpenPolicy(path));
  // Programs before 0.2.0 evaluated the raw policy and kept no other.
  return PlayedPolicy{WithActing(std::move(policy), RAW), PlayedChoice::kBest};
}

absl::Status HasNoAverage(const std::string& file_or_run, const PolicySnapshot& snapshot) {
  std::vector<std::string> names;
  for (const auto& network : snapshot.networks) names.push_back(network.first);
  return absl::InvalidArgumentError(absl::StrCat(
      "--which average: expected a policy with its average (the network '", kPolicyAverage, "'), found ",
      file_or_run, " of ", snapshot.spec.algorithm, " with ", absl::StrJoin(names, ", "),
      ". Use --which raw: ddqn keeps no average, and neither do a run's best policy and files of before "
      "0.2.0"));
}

// What the config of a run, or the default for a file, says of a policy that has an average.
absl::StatusOr<PolicyChoice> ConfiguredChoice(const std::string& file_or_run) {
  if (!IsRun(file_or_run)) return AVERAGE;
  const absl::StatusOr<Config> config = LoadConfig(RunFolder{file_or_run}.config());
  if (config.ok()) return config->evaluation().which();
  if (absl::IsNotFound(config.status())) return AVERAGE;  // services that were started by hand keep none
  return absl::Status(
      config.status().code(),
      absl::StrCat(config.status().message(),
                   "\nThe policy to play stands in that config (evaluation.which). Mend it, or "
                   "choose with --which raw or --which average"));
}

}  // namespace

absl::string_view NameOf(PlayedChoice choice) {
  switch (choice) {
    case PlayedChoice::kRaw:
      return "raw";
    case PlayedChoice::kAverage:
      return "average";
    case PlayedChoice::kBest:
      return "best";
  }
  return "";
}

absl::StatusOr<PlayedPolicy> OpenPlayedPolicy(const std::string& file_or_run,
                                              std::optional<PlayedChoice> choice) {
  if (choice == PlayedChoice::kBest) return OpenBest(file_or_run);
  ASSIGN_OR_RETURN(std::shared_ptr<const PolicyNetworks> policy, OpenPolicy(file_or_run));
  const bool has_average = policy->snapshot().Find(kPolicyAverage) != nullptr;
  if (!has_average && choice == PlayedChoice::kAverage) return HasNoAverage(file_or_run, policy->snapshot());
  PolicyChoice played = choice == PlayedChoice::kAverage ? AVERAGE : RAW;
  if (has_average && !choice.has_value()) {
    ASSIGN_OR_RETURN(played, ConfiguredChoice(file_or_run));
  }
  return PlayedPolicy{WithActing(std::move(policy), played),
                      played == AVERAGE ? PlayedChoice::kAverage : PlayedChoice::kRaw};
}

}  // namespace dbr
