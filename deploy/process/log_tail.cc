#include "deploy/process/log_tail.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace dbr {

std::string LogTail(const std::string& path, off_t start, int lines) {
  constexpr off_t kMostBytes = 16 << 10;
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return "";
  const absl::Cleanup close_file = [fd] { close(fd); };
  const off_t end = lseek(fd, 0, SEEK_END);
  start = std::max(start, end - kMostBytes);
  if (end <= start) return "";
  std::string text(static_cast<std::size_t>(end - start), '\0');
  const ssize_t n = pread(fd, text.data(), text.size(), start);
  if (n <= 0) return "";
  text.resize(static_cast<std::size_t>(n));
  std::vector<absl::string_view> all = absl::StrSplit(text, '\n', absl::SkipWhitespace());
  if (all.size() > static_cast<std::size_t>(lines)) all.erase(all.begin(), all.end() - lines);
  return absl::StrJoin(all, "\n", [](std::string* out, absl::string_view line) {
    out->append("    ").append(line.data(), line.size());
  });
}

}  // namespace dbr
