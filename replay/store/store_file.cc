#include "replay/store/store_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/crc32c.h"
#include "core/file_io.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr char kMagic[8] = {'D', 'B', 'R', 'S', 'T', 'O', 'R', 'E'};
constexpr std::uint32_t kFormat = 3;

struct Header {
  char magic[8];
  std::uint32_t format;
  std::int32_t observation_width;
  std::int32_t action_width;
  std::int32_t mask_width;
  std::uint64_t capacity;
  std::uint64_t total_bytes;
  char env[64];
  std::int16_t return_width;
  std::int16_t next_action_width;
  std::uint32_t crc32c;  // of all before it
};
static_assert(sizeof(Header) <= StoreFile::kHeaderBytes);

std::uint32_t Checksum(const Header& header) {
  return Crc32c(&header, offsetof(Header, crc32c));
}

Header MakeHeader(const StoreShape& shape) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.format = kFormat;
  header.observation_width = shape.layout.observation_width;
  header.action_width = shape.layout.action_width;
  header.mask_width = shape.layout.mask_width;
  header.return_width = static_cast<std::int16_t>(shape.layout.return_width);
  header.next_action_width = static_cast<std::int16_t>(shape.layout.next_action_width);
  header.capacity = shape.capacity;
  header.total_bytes = shape.total_bytes;
  std::memcpy(header.env, shape.env.data(), shape.env.size());
  header.crc32c = Checksum(header);
  return header;
}

std::string Describe(const Header& header) {
  return absl::StrCat(
      "environment '", absl::string_view(header.env, strnlen(header.env, sizeof header.env)), "', widths ",
      header.observation_width, "/", header.action_width, "/", header.mask_width,
      " (observation/action/mask), ", header.return_width > 0 ? "with" : "without", " returns, ",
      header.next_action_width > 0 ? "with" : "without", " next actions, capacity ", header.capacity);
}

absl::Status CheckHeader(const std::string& path, const Header& expected, const Header& found,
                         std::uint64_t bytes) {
  if (std::memcmp(found.magic, kMagic, sizeof kMagic) != 0) {
    return absl::DataLossError(
        absl::StrCat("replay store ", path, ": this is no replay store, or its header is damaged"));
  }
  if (found.format != kFormat) {
    return absl::FailedPreconditionError(absl::StrCat(
        "replay store ", path, ": expected format ", kFormat, ", found ", found.format,
        ". Resume it with the version of this program that wrote it, or start in a new folder."));
  }
  if (found.crc32c != Checksum(found)) {
    return absl::DataLossError(absl::StrCat("replay store ", path,
                                            ": its header is damaged (checksum: expected ", found.crc32c,
                                            ", found ", Checksum(found), ")"));
  }
  if (std::memcmp(&expected, &found, offsetof(Header, total_bytes)) != 0 ||
      std::memcmp(expected.env, found.env, sizeof found.env) != 0 ||
      expected.return_width != found.return_width || expected.next_action_width != found.next_action_width) {
    return absl::FailedPreconditionError(absl::StrCat(
        "replay store ", path, " was made for another set-up: expected ", Describe(expected), "; found ",
        Describe(found), ". Resume with the run's own config, or start in a new folder."));
  }
  if (found.total_bytes != expected.total_bytes || bytes != expected.total_bytes) {
    return absl::DataLossError(absl::StrCat("replay store ", path, " is truncated: expected ",
                                            expected.total_bytes, " bytes, found ", bytes));
  }
  return absl::OkStatus();
}

absl::Status Lock(int fd, const std::string& path) {
  if (flock(fd, LOCK_EX | LOCK_NB) == 0) return absl::OkStatus();
  if (errno == EWOULDBLOCK) {
    return absl::FailedPreconditionError(absl::StrCat(
        "replay store ", path, " is in use by another process. Stop it or choose another run folder."));
  }
  return ErrnoStatus(errno, "cannot lock", path);
}

absl::StatusOr<std::byte*> Map(int fd, const std::string& path, std::uint64_t bytes) {
  const int flags = fd < 0 ? MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE : MAP_SHARED;
  void* map = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, flags, fd, 0);
  if (map == MAP_FAILED) return ErrnoStatus(errno, absl::StrCat("cannot map ", bytes, " bytes of"), path);
  return static_cast<std::byte*>(map);
}

absl::Status Reserve(int fd, const std::string& path, std::uint64_t bytes) {
  int error_number = 0;
  do {
    error_number = posix_fallocate(fd, 0, static_cast<off_t>(bytes));
  } while (error_number == EINTR);
  if (error_number == 0) return absl::OkStatus();
  return ErrnoStatus(error_number, absl::StrCat("cannot reserve ", bytes, " bytes for the replay store"),
                     path);
}

// The file gets its name only when it is complete, so that a store by that name is never half made.
absl::StatusOr<int> Create(const std::string& path, const Header& header) {
  if (access(path.c_str(), F_OK) == 0) {
    return absl::AlreadyExistsError(absl::StrCat(
        "replay store ", path, " exists already: continue it with --resume, or start in a new folder."));
  }
  const std::string unfinished = absl::StrCat(path, ".new");
  const int fd = open(unfinished.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return ErrnoStatus(errno, "cannot create the replay store", unfinished);
  absl::Cleanup close_file = [fd] { close(fd); };
  RETURN_IF_ERROR(Lock(fd, path));
  absl::Cleanup remove_file = [&unfinished] { unlink(unfinished.c_str()); };
  if (ftruncate(fd, 0) != 0) return ErrnoStatus(errno, "cannot empty", unfinished);
  RETURN_IF_ERROR(Reserve(fd, path, header.total_bytes));
  if (pwrite(fd, &header, sizeof header, 0) != sizeof header)
    return ErrnoStatus(errno, "cannot write", unfinished);
  if (rename(unfinished.c_str(), path.c_str()) != 0) return ErrnoStatus(errno, "cannot rename to", path);
  std::move(remove_file).Cancel();
  std::move(close_file).Cancel();
  return fd;
}

absl::StatusOr<int> Reopen(const std::string& path, const Header& expected) {
  const int fd = open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0 && errno == ENOENT) {
    return absl::NotFoundError(
        absl::StrCat("replay store ", path,
                     ": there is nothing to resume. Name the folder of a run, or leave out --resume."));
  }
  if (fd < 0) return ErrnoStatus(errno, "cannot open the replay store", path);
  absl::Cleanup close_file = [fd] { close(fd); };
  RETURN_IF_ERROR(Lock(fd, path));
  struct stat info;
  if (fstat(fd, &info) != 0) return ErrnoStatus(errno, "cannot look at", path);
  Header found{};
  if (pread(fd, &found, sizeof found, 0) != sizeof found) {
    return absl::DataLossError(absl::StrCat("replay store ", path, " is truncated: expected ",
                                            expected.total_bytes, " bytes, found ", info.st_size));
  }
  RETURN_IF_ERROR(CheckHeader(path, expected, found, static_cast<std::uint64_t>(info.st_size)));
  std::move(close_file).Cancel();
  return fd;
}

}  // namespace

absl::StatusOr<std::unique_ptr<StoreFile>> StoreFile::Open(const std::string& path, const StoreShape& shape,
                                                           bool resume) {
  if (shape.env.size() >= sizeof(Header::env)) {
    return absl::InvalidArgumentError(absl::StrCat("environment name '", shape.env, "': expected at most ",
                                                   sizeof(Header::env) - 1, " bytes, found ",
                                                   shape.env.size()));
  }
  int fd = -1;
  if (!path.empty()) {
    const Header header = MakeHeader(shape);
    ASSIGN_OR_RETURN(fd, resume ? Reopen(path, header) : Create(path, header));
  }
  const auto map = Map(fd, path.empty() ? "memory" : path, shape.total_bytes);
  if (!map.ok()) {
    if (fd >= 0) close(fd);
    return map.status();
  }
  return std::unique_ptr<StoreFile>(new StoreFile(path, fd, *map, shape.total_bytes));
}

StoreFile::~StoreFile() {
  munmap(map_, bytes_);
  if (fd_ >= 0) close(fd_);
}

absl::Status StoreFile::Sync() {
  if (fd_ < 0) return absl::OkStatus();
  if (msync(map_, bytes_, MS_SYNC) != 0) return ErrnoStatus(errno, "cannot write to disk", path_);
  return absl::OkStatus();
}

}  // namespace dbr
