#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_join.h"
#include "core/status_macros.h"
#include "deploy/cli/algorithm_report.h"
#include "deploy/cli/command_line.h"

namespace dbr {
namespace {

struct AlgorithmsFlags {
  std::string name;
  bool json = false;
};

absl::Status RunAlgorithms(const AlgorithmsFlags& flags) {
  std::string text;
  if (!flags.name.empty()) {
    ASSIGN_OR_RETURN(const AlgorithmFacts algorithm, FindAlgorithm(flags.name));
    text = flags.json ? ToJson(algorithm).dump() + "\n" : AlgorithmText(algorithm);
  } else if (flags.json) {
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    for (const AlgorithmFacts& algorithm : AllAlgorithms()) all.push_back(ToJson(algorithm));
    text = all.dump() + "\n";
  } else {
    text = AlgorithmTable(AllAlgorithms());
  }
  std::fputs(text.c_str(), stdout);
  return absl::OkStatus();
}

std::string AlgorithmNames() {
  return absl::StrJoin(AllAlgorithms(), "|",
                       [](std::string* out, const AlgorithmFacts& one) { *out += one.name; });
}

}  // namespace

void AddAlgorithms(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<AlgorithmsFlags>();
  CLI::App* command =
      app->add_subcommand("algorithms", "List the algorithms, or show how one of them is set");
  command
      ->add_option("NAME", flags->name,
                   "Show one algorithm: its whole config message, with defaults and bounds")
      ->type_name(AlgorithmNames());
  command->add_flag("--json", flags->json,
                    "Print one JSON object {name, actions, source, variants, fields}, or a list of all");
  command->footer(
      "Examples:\n"
      "  dbr algorithms\n"
      "  dbr algorithms dbr");
  command->callback([flags, exit_code] {
    const absl::Status status = RunAlgorithms(*flags);
    *exit_code = status.ok() ? 0 : Fail("algorithms", status);
  });
}

}  // namespace dbr
