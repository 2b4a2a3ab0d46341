#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/stats_report.h"
#include "deploy/launch/run_access.h"
#include "deploy/process/interrupt.h"
#include "deploy/terminal/terminal.h"
#include "replay/client/client.h"

namespace dbr {
namespace {

constexpr absl::Duration kTimeout = absl::Seconds(5);
constexpr absl::Duration kWatchEvery = absl::Seconds(1);

struct StatsFlags {
  std::string replay;
  bool json = false;
  bool watch = false;
};

void Print(const StatsFlags& flags, const std::string& address, const StatsReply& stats) {
  if (flags.json) {
    const auto replace = nlohmann::ordered_json::error_handler_t::replace;
    std::printf("%s\n", ToJson(stats).dump(-1, ' ', false, replace).c_str());
  } else {
    // While watching, each answer takes the place of the one before.
    const bool redraw = flags.watch && IsTerminal(STDOUT_FILENO);
    std::printf("%s%s", redraw ? "\033[H\033[2J" : "", StatsText(address, stats).c_str());
  }
  std::fflush(stdout);
}

absl::StatusOr<int> RunStats(const StatsFlags& flags) {
  ASSIGN_OR_RETURN(const std::string address, ReplayAddress(flags.replay));
  Interrupt interrupt;
  ReplayClient client(address);
  do {
    const absl::StatusOr<StatsReply> stats = client.Stats(kTimeout);
    if (interrupt.flag()) break;
    if (!stats.ok()) {
      return absl::Status(stats.status().code(), absl::StrCat("no answer from the replay server at ", address,
                                                              ": ", stats.status().message()));
    }
    Print(flags, address, *stats);
    if (std::ferror(stdout) != 0) break;  // nobody reads it, and main says so
  } while (flags.watch && !interrupt.WaitFor(kWatchEvery));
  return interrupt.flag() ? kInterruptedExit : 0;
}

}  // namespace

void AddStats(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<StatsFlags>();
  CLI::App* command =
      app->add_subcommand("stats", "Show the state of a replay server: partitions, rates, labels, clients");
  command
      ->add_option("--replay", flags->replay,
                   "Address of the server, unix:PATH or HOST:PORT, or its run folder")
      ->required()
      ->type_name("ADDRESS_OR_RUN");
  command->add_flag("--json", flags->json,
                    "Print one JSON object; with --watch, one a second, each on a line of its own");
  command->add_flag("--watch", flags->watch, "Ask again every second, until Ctrl-C");
  command->footer(
      "Examples:\n"
      "  dbr stats --replay runs/quickstart --watch\n"
      "  dbr stats --replay 127.0.0.1:7000 --json");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunStats(*flags);
    *exit_code = result.ok() ? *result : Fail("stats", result.status());
  });
}

}  // namespace dbr
