#include "tests/docs/working_folder.h"

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/file_io.h"

namespace dbr {
namespace {

namespace fs = std::filesystem;

// Later settings win over the page's own.
constexpr char kShorter[] =
    "--set launch.max_seconds=8 --set evaluation.every_s=1 --set evaluation.episodes=1 "
    "--set evaluation.final_episodes=5";
constexpr char kShorterOffline[] = "--set learner.offline_updates=20";

std::string Wrapper() {
  return absl::StrCat("#!/bin/bash\n",
                      "# Written by docs_test: passes everything on; tests/docs/working_folder.h says what is changed.\n",
                      "case \"$1\" in\n",
                      "  launch)\n",
                      "    offline=\n",
                      "    case \" $* \" in *\" --seed-buffer \"*) offline='", kShorterOffline, "' ;; esac\n",
                      "    exec \"", DBR_BIN_DIR, "/dbr\" \"$@\" ", kShorter, " $offline ;;\n",
                      "  stats)\n",
                      "    for attempt in $(seq 60); do\n",
                      "      \"", DBR_BIN_DIR, "/dbr\" \"$@\" > stats.try 2>&1 && break\n",
                      "      sleep 0.5\n",
                      "    done ;;\n",
                      "esac\n",
                      "exec \"", DBR_BIN_DIR, "/dbr\" \"$@\"\n");
}

}  // namespace

WorkingFolder::WorkingFolder() {
  const fs::path bin = folder_ / "build/bin";
  fs::create_directories(bin);
  for (const auto& program : fs::directory_iterator(DBR_BIN_DIR)) {
    if (program.path().filename() != "dbr") fs::create_symlink(program.path(), bin / program.path().filename());
  }
  const std::string wrapper = bin / "dbr";
  DBR_CHECK(WriteFileAtomically(wrapper, Wrapper()).ok());
  fs::permissions(wrapper, fs::perms::owner_all);
  fs::create_directory_symlink(absl::StrCat(DBR_SOURCE_DIR, "/deploy"), folder_ / "deploy");
}

std::pair<int, std::string> WorkingFolder::Run(const std::string& script, int timeout_s) const {
  const std::string file = folder_ / "commands.sh", output = folder_ / "commands.out";
  DBR_CHECK(WriteFileAtomically(file, script).ok());
  const int status = std::system(absl::StrCat("cd '", folder_.path(), "' && timeout --kill-after=20 ", timeout_s,
                                              " bash commands.sh > commands.out 2>&1 < /dev/null")
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), ReadFile(output).value_or("")};
}

bool WorkingFolder::Holds(const std::string& path) const {
  std::error_code missing;
  const auto bytes = fs::file_size(folder_ / path, missing);
  return !missing && bytes > 0;
}

}  // namespace dbr
