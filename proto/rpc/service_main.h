// What the mains of the service programs share: their flags and how an address is chosen.
#pragma once

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/run_folder.h"
#include "proto/rpc/address.h"

namespace dbr {

// What the flags say.
struct ServiceArguments {
  std::string config_path;
  RunFolder folder;
  std::string address;  // to serve on; empty: the config's, else the run folder's socket
  bool resume = false;
  bool allow_insecure = false;
};

// Declares the flags: `app` fills `arguments`, which outlive it, while it parses. The two texts say for
// --help what lies in the run folder and what --resume continues.
inline void AddServiceFlags(const std::string& folder_holds, const std::string& resumes,
                            ServiceArguments* arguments, CLI::App* app) {
  app->add_option("--config", arguments->config_path, "Config file")->required()->type_name("FILE");
  app->add_option("--run-dir", arguments->folder.root, folder_holds)->required()->type_name("DIR");
  app->add_option("--address", arguments->address,
                  "Address to serve on [the config's, else a unix socket in the run folder]")
      ->type_name("ADDRESS");
  app->add_flag("--resume", arguments->resume, resumes);
  app->add_flag("--allow-insecure", arguments->allow_insecure,
                "Serve an address that other machines can reach");
}

// Makes the log that a service program writes to stderr, and makes it the default one. On a terminal the
// level has a colour, unless NO_COLOR is set (no-color.org) or the terminal is none for colours.
inline void UseStderrLog(const std::string& name) {
  const std::shared_ptr<spdlog::logger> log = spdlog::stderr_color_mt(name);
  const char* const no_color = std::getenv("NO_COLOR");
  const char* const terminal = std::getenv("TERM");
  const bool plain = (no_color != nullptr && *no_color != '\0') || terminal == nullptr ||
                     absl::string_view(terminal) == "dumb";
  if (plain)
    static_cast<spdlog::sinks::stderr_color_sink_mt&>(*log->sinks()[0])
        .set_color_mode(spdlog::color_mode::never);
  spdlog::set_default_logger(log);
}

// The address that the flag gives, else the config's, else the run folder's; empty means not given.
// InvalidArgument where it is none (proto/rpc/address.h).
inline absl::StatusOr<std::string> ChooseAddress(const std::string& flag, const std::string& configured,
                                                 const std::string& otherwise) {
  const std::string& given = flag.empty() ? configured : flag;
  const std::string& chosen = given.empty() ? otherwise : given;
  if (const absl::Status status = ParseAddress(chosen).status(); !status.ok()) return status;
  return chosen;
}

}  // namespace dbr
