#include "proto/rpc/socket_path.h"

#include <fcntl.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/file_io.h"

namespace dbr {
namespace {

constexpr std::size_t kMostBytes = sizeof(sockaddr_un::sun_path) - 1;

bool IsPlain(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '/' || c == '.' || c == '_' || c == '-';
}

}  // namespace

absl::StatusOr<std::shared_ptr<const SocketPath>> SocketPath::Open(const std::string& path) {
  if (path.size() <= kMostBytes && std::all_of(path.begin(), path.end(), IsPlain)) {
    return std::shared_ptr<const SocketPath>(new SocketPath(path, -1));
  }
  const std::size_t slash = path.rfind('/');
  const std::string name = slash == std::string::npos ? path : path.substr(slash + 1);
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int fd = open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return ErrnoStatus(errno, "cannot open", folder);
  std::shared_ptr<const SocketPath> opened(new SocketPath(absl::StrCat("/proc/self/fd/", fd, "/", name), fd));
  if (opened->reachable().size() <= kMostBytes) return opened;
  return absl::InvalidArgumentError(absl::StrCat("socket path '", path, "': expected a name of at most ",
                                                 name.size() - (opened->reachable().size() - kMostBytes),
                                                 " bytes behind the last '/', found ", name.size(),
                                                 ". Use a shorter name; the folder's may be long."));
}

SocketPath::~SocketPath() {
  if (folder_ >= 0) close(folder_);
}

std::string SocketPath::GrpcAddress() const {
  return absl::StrCat("unix:", PercentEncode(reachable_));
}

std::string PercentEncode(const std::string& text) {
  std::string encoded;
  for (const char c : text) {
    if (IsPlain(c)) {
      encoded.push_back(c);
    } else {
      absl::StrAppendFormat(&encoded, "%%%02X", static_cast<unsigned char>(c));
    }
  }
  return encoded;
}

}  // namespace dbr
