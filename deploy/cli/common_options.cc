#include "deploy/cli/common_options.h"

#include <CLI/CLI.hpp>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "deploy/cli/shipped_file.h"
#include "deploy/launch/run_access.h"
#include "deploy/manual/number_option.h"

namespace dbr {

CLI::Option* AddPolicyOption(CLI::App* command, std::string* policy) {
  return command->add_option("--policy", *policy, "A policy file, or a run folder for its newest policy")
      ->required()
      ->type_name("FILE_OR_RUN");
}

CLI::Option* AddWhichOption(CLI::App* command, std::string* which) {
  return command
      ->add_option(
          "--which", *which,
          "Which policy plays: the newest one, raw as actors use it, or its average, or the run's best "
          "[evaluation.which of the run's config; for a file average, where it has one]")
      ->type_name("raw|average|best");
}

CLI::Option* AddModeOption(CLI::App* command, const std::string& text, std::string* mode) {
  return command->add_option("--mode", *mode, text)
      ->capture_default_str()
      ->type_name("sample|mode|greedy_q|support");
}

CLI::Option* AddSeedOption(CLI::App* command, const std::string& text, std::uint64_t* seed) {
  return command->add_option("--seed", *seed, text)
      ->capture_default_str()
      ->transform(WholeNumber())
      ->type_name("N");
}

absl::StatusOr<std::shared_ptr<const PolicyNetworks>> OpenNamedPolicy(const std::string& name) {
  ASSIGN_OR_RETURN(const std::string path, FindShippedFile(name));
  return OpenPolicy(path);
}

absl::StatusOr<PlayedPolicy> OpenNamedPolicy(const std::string& name, const std::string& which) {
  ASSIGN_OR_RETURN(const std::string path, FindShippedFile(name));
  if (which.empty()) return OpenPlayedPolicy(path, std::nullopt);
  for (const PlayedChoice choice : {PlayedChoice::kRaw, PlayedChoice::kAverage, PlayedChoice::kBest}) {
    if (absl::AsciiStrToLower(which) == NameOf(choice)) return OpenPlayedPolicy(path, choice);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--which: expected raw, average or best, found '", which, "'"));
}

absl::StatusOr<ActingMode> ParseActingMode(const std::string& name) {
  ActingMode mode;
  if (ActingMode_Parse(absl::AsciiStrToUpper(name), &mode)) return mode;
  return absl::InvalidArgumentError(
      absl::StrCat("--mode: expected sample, mode, greedy_q or support, found '", name, "'"));
}

}  // namespace dbr
