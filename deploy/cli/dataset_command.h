// What the subcommands of `dbr dataset` share.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "deploy/cli/dataset_report.h"
#include "deploy/process/interrupt.h"
#include "replay/dataset/dataset_reader.h"

namespace CLI {
class App;
}

namespace dbr {

// How often a subcommand says how far it has come where the output is no terminal.
inline constexpr absl::Duration kProgressEvery = absl::Seconds(10);

// Adds `record` to the command `dataset`, as the functions of command_line.h add to the program.
void AddDatasetRecord(CLI::App* dataset, int* exit_code);

// The layout that `name`, the value of `option`, stands for; none for "". InvalidArgument, naming the option.
absl::StatusOr<std::optional<DatasetLayout>> ParseLayoutOption(const std::string& option,
                                                               const std::string& name);

// Reads the whole file (or that of a Minari dataset's folder) and reports on it; bad rows are counted and
// left out. `layout`: none takes the file's own word. Blocks. Errors: DatasetReader::Open's and Next's,
// naming the file; Cancelled after the user's interrupt.
absl::StatusOr<DatasetReport> ReportDataset(const std::string& path, std::optional<DatasetLayout> layout,
                                            const Interrupt& interrupt);

}  // namespace dbr
