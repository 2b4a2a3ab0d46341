// What the subcommands of `dbr` share.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nn/policy.h"

namespace CLI {
class App;
}

namespace dbr {

// Each adds its subcommand to `app`; the subcommand runs while the command line is parsed and leaves its exit
// status in `exit_code`.
void AddLaunch(CLI::App* app, int* exit_code);
void AddStats(CLI::App* app, int* exit_code);
void AddEvaluate(CLI::App* app, int* exit_code);
void AddProbe(CLI::App* app, int* exit_code);
void AddDataset(CLI::App* app, int* exit_code);
void AddExperiment(CLI::App* app, int* exit_code);
void AddReport(CLI::App* app, int* exit_code);
void AddAlgorithms(CLI::App* app, int* exit_code);

// Prints "dbr COMMAND: MESSAGE" to stderr; 2 for what the user typed or wrote (InvalidArgument), 1 for the
// rest.
int Fail(absl::string_view command, const absl::Status& status);

// The folder of this program: the service programs stand beside it.
absl::StatusOr<std::string> ProgramsFolder();

// "sample", "mode", "greedy_q" or "support", in any case.
absl::StatusOr<ActingMode> ParseActingMode(const std::string& name);

}  // namespace dbr
