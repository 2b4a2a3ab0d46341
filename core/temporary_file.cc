#include "core/temporary_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/file_io.h"

namespace dbr {
namespace {

// ".dbr-PID-COUNT.partial"
constexpr char kPrefix[] = ".dbr-";
constexpr char kSuffix[] = ".partial";

std::string FolderOf(const std::string& path) {
  const auto slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

bool IsName(absl::string_view name) {
  const auto fits = [](char c) { return absl::ascii_isdigit(static_cast<unsigned char>(c)) || c == '-'; };
  return absl::ConsumePrefix(&name, kPrefix) && absl::ConsumeSuffix(&name, kSuffix) &&
         std::all_of(name.begin(), name.end(), fits);
}

// False where another open file has the lock, or there are no locks. It belongs to the open file and not to
// the process.
bool Lock(int fd) {
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  return fcntl(fd, F_OFD_SETLK, &whole) == 0;
}

// Whether the open file still has its name.
bool IsNamed(int fd) {
  struct stat found;
  return fstat(fd, &found) == 0 && found.st_nlink > 0;
}

// Removes the temporary `name` in the open folder if its process is dead.
void RemoveIfDead(int folder, const char* name) {
  struct stat found;
  if (fstatat(folder, name, &found, AT_SYMLINK_NOFOLLOW) != 0) return;
  if (!S_ISREG(found.st_mode) || found.st_uid != geteuid()) return;
  const int fd = openat(folder, name, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return;
  // Whoever makes a file now sees at its own lock, or at the name that is gone, that it must make another.
  if (Lock(fd) && IsNamed(fd)) unlinkat(folder, name, 0);
  close(fd);
}

void RemoveDead(const std::string& path) {
  DIR* const folder = opendir(path.c_str());
  if (folder == nullptr) return;
  const absl::Cleanup close_folder = [folder] { closedir(folder); };
  while (const dirent* entry = readdir(folder)) {
    if (IsName(entry->d_name)) RemoveIfDead(dirfd(folder), entry->d_name);
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<TemporaryFile>> TemporaryFile::Create(const std::string& path) {
  static std::atomic<unsigned> count = 0;
  const std::string folder = FolderOf(path);
  RemoveDead(folder);
  constexpr int kAttempts = 1000;  // a name may be another machine's, or be removed before it is locked
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    std::string name = absl::StrCat(folder, "/", kPrefix, getpid(), "-", count++, kSuffix);
    const int fd = open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0 && errno == EEXIST) continue;
    if (fd < 0) return ErrnoStatus(errno, "cannot create", path);
    const bool locked = Lock(fd);
    const bool contested = !locked && (errno == EAGAIN || errno == EACCES);
    if (!contested && IsNamed(fd))
      return std::unique_ptr<TemporaryFile>(new TemporaryFile(path, std::move(name), fd));
    close(fd);
  }
  return ErrnoStatus(EEXIST, "cannot create a temporary file for", path);
}

TemporaryFile::~TemporaryFile() {
  if (!committed_) unlink(name_.c_str());
  close(fd_);
}

absl::Status TemporaryFile::Commit() {
  if (fsync(fd_) != 0) return ErrnoStatus(errno, "cannot flush", path_);
  if (rename(name_.c_str(), path_.c_str()) != 0) return ErrnoStatus(errno, "cannot rename to", path_);
  committed_ = true;
  const int folder = open(FolderOf(path_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    fsync(folder);
    close(folder);
  }
  return absl::OkStatus();
}

}  // namespace dbr
