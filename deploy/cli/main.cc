// dbr: launches runs, and asks about them.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/exhaustion.h"
#include "core/shutdown.h"
#include "core/standard_streams.h"
#include "deploy/cli/command_line.h"
#include "deploy/launch/commit.h"
#include "deploy/manual/man_page.h"
#include "nn/product/blas_setup.h"
#include "nn/product/product_library.h"
#include "proto/config/config_fields.h"

namespace {

constexpr int kClosedPipeExit = 128 + SIGPIPE;  // as the shell tells of programs that the signal ended

// Runs leave their results in files, and a terminal or a log that is gone does not make them fail.
bool ResultIsPrinted(const CLI::App& app) {
  if (app.got_subcommand("launch")) return app.get_subcommand("launch")->count("--help") > 0;
  if (!app.got_subcommand("experiment")) return true;
  const CLI::App* const experiment = app.get_subcommand("experiment");
  return experiment->count("--help") + experiment->count("--dry-run") > 0;
}

// The exit status, unless what was printed is lost: then the command has failed. A reader that has gone away
// knows that, and is told nothing.
int WithLostOutput(int exit_code) {
  bool reader_gone = false;
  std::cout.flush();
  const std::string lost = dbr::LostOutput(&reader_gone);
  if (lost.empty()) return exit_code;
  if (reader_gone) return exit_code == 0 ? kClosedPipeExit : exit_code;
  std::fprintf(stderr, "dbr: the output is lost, or a part of it: %s. Give it a place and call again.\n",
               lost.c_str());
  return exit_code == 0 ? 1 : exit_code;
}

// Says which word is no command, where that is what is wrong: CLI11 says only that a command is missing.
bool WithUnknownCommand(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return false;
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), argv[1]) != names.end()) return false;
  std::fprintf(stderr, "dbr: unknown command '%s'; %s\n", argv[1], dbr::Suggest(argv[1], names).c_str());
  return true;
}

// What multiplies matrices on this machine, in each precision that there is.
std::string Kernels() {
  const std::string float32 = absl::StrCat("matrix products: ", dbr::KernelsName(/*bfloat16=*/false));
  if (!dbr::HasBfloat16()) {
    return absl::StrCat(float32, "; no bfloat16: the processor has ", dbr::ProcessorInstructions());
  }
  return absl::StrCat(float32, "; ", dbr::KernelsName(/*bfloat16=*/true));
}

int Main(int argc, char** argv) {
  CLI::App app("Dual Behavior Regularized reinforcement learning: trains, watches and examines policies.",
               "dbr");
  app.require_subcommand(1);
  app.footer(
      "Each command has its own --help. The files deploy/... of the examples come with dbr, wherever it is\n"
      "installed; where the working folder has a file of that name, that one is taken.\n\n"
      "Example: dbr launch deploy/configs/connect4.textproto");
  app.set_version_flag(
      "--version", absl::StrCat("dbr ", DBR_VERSION, ", commit ", dbr::BuildCommit(), "\n", Kernels()),
      "Print the version, the commit that dbr was built from and what multiplies matrices here");
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
    exit_code = WithUnknownCommand(app, argc, argv) ? 2 : app.exit(error) == 0 ? 0 : 2;
  }
  return ResultIsPrinted(app) ? WithLostOutput(exit_code) : exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  dbr::RestartWithBlasSetUp(argv);  // and so do the programs that we start
  dbr::HoldStandardStreams();
  dbr::EndWhereResourcesAreExhausted();
  dbr::IgnoreWriteSignals();
  return Main(argc, argv);
}
