#include "deploy/cli/command_line.h"

#include <cstdio>
#include <filesystem>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace dbr {

int Fail(absl::string_view command, const absl::Status& status) {
  std::fprintf(stderr, "dbr %s: %s\n", std::string(command).c_str(), std::string(status.message()).c_str());
  return absl::IsInvalidArgument(status) ? 2 : 1;
}

absl::StatusOr<std::string> ProgramsFolder() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return absl::InternalError(absl::StrCat("cannot read /proc/self/exe: ", error.message()));
  return self.parent_path().string();
}

absl::StatusOr<ActingMode> ParseActingMode(const std::string& name) {
  ActingMode mode;
  if (ActingMode_Parse(absl::AsciiStrToUpper(name), &mode)) return mode;
  return absl::InvalidArgumentError(
      absl::StrCat("--mode: expected sample, mode, greedy_q or support, found '", name, "'"));
}

}  // namespace dbr
