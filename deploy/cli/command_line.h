// What the subcommands of `dbr` share.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace CLI {
class App;
}

namespace dbr {

// Each adds one subcommand to `app`. The subcommand runs while `app` parses the command line, and leaves its
// exit status in `exit_code`, which must outlive `app`: 0 for success, Fail's for an error, 130 after Ctrl-C.
void AddLaunch(CLI::App* app, int* exit_code);
void AddStats(CLI::App* app, int* exit_code);
void AddEvaluate(CLI::App* app, int* exit_code);
void AddProbe(CLI::App* app, int* exit_code);
void AddDataset(CLI::App* app, int* exit_code);
void AddExperiment(CLI::App* app, int* exit_code);
void AddReport(CLI::App* app, int* exit_code);
void AddAlgorithms(CLI::App* app, int* exit_code);
void AddCompletion(CLI::App* app, int* exit_code);

// Prints "dbr COMMAND: MESSAGE" to stderr and gives the exit status: 2 where the user typed or wrote
// something wrong (InvalidArgument), 130 after Ctrl-C (Cancelled), else 1.
int Fail(absl::string_view command, const absl::Status& status);

// The folder of this program, in which the service programs stand as well: bin of the build folder or of the
// prefix that dbr is installed in. Internal where the system does not say it.
absl::StatusOr<std::string> ProgramsFolder();

}  // namespace dbr
