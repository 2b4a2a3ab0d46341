#include "deploy/cli/command_line.h"

#include <cstdio>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "deploy/process/interrupt.h"

namespace dbr {

int Fail(absl::string_view command, const absl::Status& status) {
  std::fprintf(stderr, "dbr %s: %s\n", std::string(command).c_str(), std::string(status.message()).c_str());
  if (absl::IsCancelled(status)) return kInterruptedExit;
  return absl::IsInvalidArgument(status) ? 2 : 1;
}

absl::StatusOr<std::string> ProgramsFolder() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return absl::InternalError(absl::StrCat("cannot read /proc/self/exe: ", error.message()));
  return self.parent_path().string();
}

}  // namespace dbr
