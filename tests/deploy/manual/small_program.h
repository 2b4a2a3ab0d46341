// A command line with something of every kind, for the tests of manual pages and completion.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace dbr {

struct SmallProgram {
  SmallProgram() {
    app.require_subcommand(1);
    app.footer("Each command has its own --help.");
    CLI::App* run = app.add_subcommand("run", "Run it [now]: isn't this easy?");
    run->add_option("CONFIG", config, "Config file")->type_name("FILE");
    run->add_option("--set", sets, "Override a field")
        ->type_name("PATH=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    run->add_option("--mode", mode, "How it acts")->capture_default_str()->type_name("fast|slow|steps:N");
    run->add_option("-j,--jobs", jobs, "How many at once")->check(CLI::Range(1, 9))->type_name("N");
    run->add_option("--run-dir", run_dir, "Folder of the run")->required()->type_name("DIR");
    run->add_flag("--dry-run", dry, "Run nothing");
    run->add_option("--secret", secret, "Not for users")->group("");
    run->footer(
        "Saves all.\nExit status: 0 in the end.\n\nExamples:\n  tool run --run-dir 'a\\b'\n  tool run");
    CLI::App* data = app.add_subcommand("data", "Record and examine");
    CLI::App* record = data->add_subcommand("record", "Record steps");
    record->add_option("--env", env, "What to record")->type_name("hopper|ant");
    CLI::App* info = data->add_subcommand("info", "Show a file");
    info->add_option("FILES", files, "Files")->required()->type_name("FILE");
  }

  CLI::App app{"A small tool.", "tool"};
  std::string config, mode = "fast", run_dir, secret, env;
  std::vector<std::string> sets, files;
  int jobs = 0;
  bool dry = false;
};

}  // namespace dbr
