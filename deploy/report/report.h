// The report over an experiment's runs: the published table with ours beside it, plots, and every cell.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace dbr::report {

struct ReportOptions {
  std::vector<std::string> runs;  // folders of experiments; see LoadRuns
  std::string grid;               // a file; empty: as the folders have it
  std::string out;                // a folder; made where it is not there
};

struct ReportOutcome {
  std::string counts;              // "3 of 12 cells done, 1 running, 8 not run"
  std::vector<std::string> notes;  // what was left out or damaged
  absl::Status plots;              // why there are none; the rest of the report is whole
};

// Writes out/report.md, out/report.html (which needs no other file) and the pictures in out/plots. Blocks,
// mostly in gnuplot. Errors: see LoadRuns; PermissionDenied, ResourceExhausted or others, naming the path,
// where `out` cannot be written; Cancelled, with no report written, where gnuplot was interrupted.
absl::StatusOr<ReportOutcome> WriteReport(const ReportOptions& options);

}  // namespace dbr::report
