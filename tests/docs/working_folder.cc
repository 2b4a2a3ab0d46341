#include "tests/docs/working_folder.h"

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/check.h"
#include "core/file_io.h"

namespace dbr {
namespace {

namespace fs = std::filesystem;

// build/bin/dbr of the folder. Settings that come later win over the page's own.
constexpr char kWrapper[] = R"(#!/bin/bash
# Written by docs_test: passes everything on; tests/docs/working_folder.h says what is changed.
dbr='BIN_DIR/dbr'
case "$1" in
  launch)
    shorter=(launch.max_seconds=12 learner.push_every=10
             evaluation.every_s=1 evaluation.episodes=1 evaluation.final_episodes=5)
    case " $* " in *' --seed-buffer '*) shorter+=(learner.offline_updates=20) ;; esac
    exec "$dbr" "$@" "${shorter[@]/#/--set=}" ;;
  dataset)
    words=("$@")
    for i in "${!words[@]}"; do [ "${words[i]}" = --steps ] && words[i + 1]=5000; done
    set -- "${words[@]}" ;;
  stats)
    for attempt in {1..120}; do
      "$dbr" "$@" > stats.try 2>&1 && break
      sleep 0.5
    done ;;
esac
exec "$dbr" "$@"
)";

}  // namespace

WorkingFolder::WorkingFolder() {
  const fs::path bin = folder_ / "build/bin";
  fs::create_directories(bin);
  for (const auto& program : fs::directory_iterator(DBR_BIN_DIR)) {
    if (program.path().filename() != "dbr")
      fs::create_symlink(program.path(), bin / program.path().filename());
  }
  const std::string wrapper = bin / "dbr";
  DBR_CHECK(WriteFileAtomically(wrapper, absl::StrReplaceAll(kWrapper, {{"BIN_DIR", DBR_BIN_DIR}})).ok());
  fs::permissions(wrapper, fs::perms::owner_all);
  fs::create_directory_symlink(absl::StrCat(DBR_SOURCE_DIR, "/deploy"), folder_ / "deploy");
}

std::pair<int, std::string> WorkingFolder::Run(const std::string& script, int timeout_s) const {
  const std::string file = folder_ / "commands.sh", output = folder_ / "commands.out";
  DBR_CHECK(WriteFileAtomically(file, script).ok());
  const int status = std::system(absl::StrCat("cd '", folder_.path(), "' && timeout --kill-after=20 ",
                                              timeout_s, " bash commands.sh > commands.out 2>&1 < /dev/null")
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), ReadFile(output).value_or("")};
}

bool WorkingFolder::Holds(const std::string& path) const {
  std::error_code missing;
  const auto bytes = fs::file_size(folder_ / path, missing);
  return !missing && bytes > 0;
}

}  // namespace dbr
