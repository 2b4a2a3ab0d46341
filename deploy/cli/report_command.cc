#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "deploy/cli/command_line.h"
#include "deploy/process/interrupt.h"
#include "deploy/report/report.h"

namespace dbr {
namespace {

absl::StatusOr<int> RunReport(const report::ReportOptions& options) {
  const absl::StatusOr<report::ReportOutcome> outcome = report::WriteReport(options);
  if (absl::IsCancelled(outcome.status())) return kInterruptedExit;
  if (!outcome.ok()) return outcome.status();
  for (const std::string& note : outcome->notes) std::fprintf(stderr, "dbr report: %s\n", note.c_str());
  std::printf("%s; wrote %s/report.md and %s/report.html\n", outcome->counts.c_str(), options.out.c_str(),
              options.out.c_str());
  if (!outcome->plots.ok()) return outcome->plots;
  return 0;
}

}  // namespace

void AddReport(CLI::App* app, int* exit_code) {
  auto options = std::make_shared<report::ReportOptions>();
  CLI::App* command = app->add_subcommand(
      "report", "Write a report on the runs of an experiment: tables, plots and every cell");
  command->add_option("RUNS", options->runs, "Folders that dbr experiment made, or copies of them")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--out", options->out,
                   "Folder for report.md, report.html and the plots; it is made if it does not exist")
      ->required()
      ->type_name("DIR");
  command->add_option("--grid", options->grid, "The grid of the experiment [RUNS/experiment.textproto]")
      ->type_name("FILE");
  command->footer(
      "report.html needs no other file. Cells that are running, that failed or that were not run are shown\n"
      "as such. A copy of a run's folder is enough if it has summary.json and config.textproto, and for the\n"
      "bars of the Connect-4 board also policy/latest.safetensors.\n\n"
      "Example: dbr report runs/paper --out runs/paper/report");
  command->callback([options, exit_code] {
    const absl::StatusOr<int> result = RunReport(*options);
    *exit_code = result.ok() ? *result : Fail("report", result.status());
  });
}

}  // namespace dbr
