// dbr: launches runs, and asks about them.
#include <CLI/CLI.hpp>

#include "absl/strings/str_cat.h"
#include "core/exhaustion.h"
#include "core/shutdown.h"
#include "deploy/cli/command_line.h"
#include "deploy/launch/commit.h"
#include "deploy/manual/man_page.h"
#include "nn/blas_setup.h"

namespace {

int Main(int argc, char** argv) {
  CLI::App app("Dual Behavior Regularized reinforcement learning: trains, watches and examines policies.",
               "dbr");
  app.require_subcommand(1);
  app.footer(
      "Each command has its own --help. The files deploy/... of the examples come with dbr, wherever it is\n"
      "installed; where the working folder has a file of that name, that one is taken.\n\n"
      "Example: dbr launch deploy/configs/connect4.textproto");
  app.set_version_flag("--version", absl::StrCat("dbr ", DBR_VERSION, ", commit ", dbr::BuildCommit()),
                       "Print the version and the commit that dbr was built from");
  int exit_code = 0;
  dbr::AddLaunch(&app, &exit_code);
  dbr::AddStats(&app, &exit_code);
  dbr::AddEvaluate(&app, &exit_code);
  dbr::AddProbe(&app, &exit_code);
  dbr::AddDataset(&app, &exit_code);
  dbr::AddExperiment(&app, &exit_code);
  dbr::AddReport(&app, &exit_code);
  dbr::AddAlgorithms(&app, &exit_code);
  dbr::AddCompletion(&app, &exit_code);
  dbr::AddManPagesOption(&app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  dbr::RestartWithBlasSetUp(argv);  // and so do the programs that we start
  dbr::EndWhereResourcesAreExhausted();
  dbr::BlockShutdownSignals();
  return Main(argc, argv);
}
