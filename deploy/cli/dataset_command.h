// What the subcommands of `dbr dataset` share.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "deploy/cli/dataset_report.h"
#include "deploy/process/interrupt.h"
#include "replay/dataset/dataset_reader.h"

namespace CLI {
class App;
}

namespace dbr {

// Adds `record` to `dataset`, as the functions of command_line.h do.
void AddDatasetRecord(CLI::App* dataset, int* exit_code);

// An option's value; empty for "". InvalidArgument, naming the option.
absl::StatusOr<std::optional<DatasetLayout>> ParseLayoutOption(const std::string& option,
                                                               const std::string& name);

// Reads the whole file, rows that are not finite counted and left out. Cancelled after the user's interrupt.
absl::StatusOr<DatasetReport> ReportDataset(const std::string& path, std::optional<DatasetLayout> layout,
                                            const Interrupt& interrupt);

}  // namespace dbr
