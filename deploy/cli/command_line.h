// What the subcommands of `dbr` share.
#pragma once

#include <memory>
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

// The policy in a file, or the newest one of a run folder. NotFound, DataLoss or InvalidArgument, naming the
// file.
absl::StatusOr<std::shared_ptr<const PolicyNetworks>> OpenPolicy(const std::string& file_or_run);

// The replay server's address: given itself, or by a run folder or a socket's path.
absl::StatusOr<std::string> ReplayAddress(const std::string& address_or_run);

}  // namespace dbr
