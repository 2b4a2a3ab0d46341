#include "deploy/launch/folder_claim.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "deploy/launch/results.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

namespace fs = std::filesystem;

constexpr int kMostNames = 1000;

std::string LockPath(const RunFolder& folder) {
  return absl::StrCat(folder.root, "/launch.lock");
}

std::string NextConfig(const RunFolder& folder) {
  return absl::StrCat(folder.config(), ".next");
}

// Locks of this kind belong to the open file: a test for one takes none, and a second one in the same process
// is refused.
struct flock WholeFile() {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  return lock;
}

absl::Status CannotMake(int error_number, const std::string& path) {
  const absl::Status status = ErrnoStatus(error_number, "cannot make the run folder", path);
  return absl::Status(status.code(), absl::StrCat(status.message(), ". Choose another --run-dir."));
}

absl::Status InUse(const RunFolder& folder) {
  return absl::FailedPreconditionError(
      absl::StrCat("run folder '", folder.root,
                   "' is in use by another launch. Wait for it or choose another --run-dir."));
}

absl::Status Taken(const RunFolder& folder) {
  return absl::AlreadyExistsError(
      absl::StrCat("run folder '", folder.root,
                   "' exists already. Say --resume to continue it, or choose another --run-dir."));
}

bool IsEmptyFolder(const std::string& path) {
  std::error_code error;
  return fs::is_empty(path, error) || error;
}

// What a run leaves behind when its store and its checkpoints are removed.
bool HasResults(const RunFolder& folder) {
  std::error_code error;
  const auto metrics = fs::file_size(folder.metrics(), error);
  return (!error && metrics > 0) || !IsEmptyFolder(folder.policies());
}

bool IsEventFile(const fs::path& path) {
  return absl::StartsWith(path.filename().string(), "events.out.tfevents.");
}

// An earlier launch made the folder, for its lock is there, and failed before its run began: nothing else is
// there but what a launch puts there itself.
bool NeverBegan(const RunFolder& folder) {
  std::error_code error;
  if (!fs::exists(LockPath(folder), error) || HasBegun(folder) || HasResults(folder)) return false;
  std::set<std::string> ours = {"replay.sock", "learner.sock"};
  for (const std::string& path :
       {LockPath(folder), folder.config(), NextConfig(folder), folder.logs(), folder.summary(),
        folder.checkpoints(), folder.policies(), folder.metrics()})
    ours.insert(fs::path(path).filename().string());
  for (fs::directory_iterator entry(folder.root, error), end; entry != end; entry.increment(error)) {
    if (!ours.contains(entry->path().filename().string()) && !IsEventFile(entry->path())) return false;
  }
  return !error;
}

// OK where nothing of value stands in the folder. `claimed`: the lock that may be there is ours.
absl::Status CheckFree(const RunFolder& folder, bool claimed) {
  std::error_code error;
  const fs::file_status there = fs::symlink_status(folder.root, error);
  if (there.type() == fs::file_type::not_found) return absl::OkStatus();
  if (error) return CannotMake(error.value(), folder.root);
  if (!fs::is_directory(folder.root, error)) {
    return absl::AlreadyExistsError(
        absl::StrCat("run folder '", folder.root, "': expected a folder or nothing, found ",
                     there.type() == fs::file_type::symlink ? "a link that leads to no folder" : "a file",
                     ". Choose another --run-dir."));
  }
  if (!claimed && IsInUse(folder)) return InUse(folder);
  for (fs::directory_iterator entry(folder.root, error), end; entry != end; entry.increment(error)) {
    if (entry->path() != LockPath(folder)) return NeverBegan(folder) ? absl::OkStatus() : Taken(folder);
  }
  return error ? CannotMake(error.value(), folder.root) : absl::OkStatus();
}

absl::Status MakeFolders(const RunFolder& folder) {
  for (const std::string& path : {folder.root, folder.logs(), folder.checkpoints(), folder.policies()}) {
    std::error_code error;
    fs::create_directories(path, error);
    if (error) return CannotMake(error.value(), path);
  }
  return absl::OkStatus();
}

// Makes the folder where there is nothing yet. Returns false where something is.
absl::StatusOr<bool> MakeFresh(const std::string& root) {
  std::error_code error;
  if (const fs::path parent = fs::path(root).parent_path(); !parent.empty())
    fs::create_directories(parent, error);
  if (error) return CannotMake(error.value(), root);
  if (mkdir(root.c_str(), 0777) == 0) return true;
  if (errno == EEXIST) return false;
  return CannotMake(errno, root);
}

}  // namespace

bool IsInUse(const RunFolder& folder) {
  const int file = open(LockPath(folder).c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return false;
  struct flock lock = WholeFile();
  const bool in_use = fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
  close(file);
  return in_use;
}

bool HasBegun(const RunFolder& folder) {
  std::error_code error;
  return fs::exists(folder.replay_store(), error) || !IsEmptyFolder(folder.checkpoints());
}

FolderClaim::FolderClaim(RunFolder folder, int lock)
    : folder_(std::move(folder)), lock_(lock), is_new_(!HasBegun(folder_)), config_path_(folder_.config()) {}

FolderClaim::~FolderClaim() {
  RemoveNextConfig();
  close(lock_);
}

absl::StatusOr<std::unique_ptr<FolderClaim>> FolderClaim::Take(const std::string& root) {
  const RunFolder folder{root};
  const std::string path = LockPath(folder);
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (file < 0) return ErrnoStatus(errno, "cannot open", path);
  struct flock lock = WholeFile();
  if (fcntl(file, F_OFD_SETLK, &lock) != 0) {
    const int error_number = errno;
    close(file);
    if (error_number != EAGAIN && error_number != EACCES)
      return ErrnoStatus(error_number, "cannot lock", path);
    return InUse(folder);
  }
  return std::unique_ptr<FolderClaim>(new FolderClaim(folder, file));
}

absl::StatusOr<std::unique_ptr<FolderClaim>> FolderClaim::New(const std::string& root) {
  RETURN_IF_ERROR(CheckFree({root}, /*claimed=*/false));
  RETURN_IF_ERROR(MakeFresh(root).status());
  ASSIGN_OR_RETURN(std::unique_ptr<FolderClaim> claim, Take(root));
  // Another launch may have been faster, and have ended already.
  RETURN_IF_ERROR(CheckFree({root}, /*claimed=*/true));
  RETURN_IF_ERROR(MakeFolders({root}));
  return claim;
}

absl::StatusOr<std::unique_ptr<FolderClaim>> FolderClaim::NewOfName(const std::string& root) {
  for (int i = 1; i <= kMostNames; ++i) {
    const std::string name = i == 1 ? root : absl::StrCat(root, "-", i);
    ASSIGN_OR_RETURN(const bool fresh, MakeFresh(name));
    if (fresh) return New(name);
  }
  return Taken({root});
}

absl::StatusOr<std::unique_ptr<FolderClaim>> FolderClaim::OfRun(const std::string& root) {
  ASSIGN_OR_RETURN(std::unique_ptr<FolderClaim> claim, Take(root));
  std::error_code error;
  if (!fs::exists(claim->folder().replay_store(), error) && (!claim->is_new() || HasResults({root}))) {
    return absl::FailedPreconditionError(absl::StrCat(
        "--resume: '", root, "' has lost its replay.store (dbr experiment removes it where a cell is done, ",
        "unless --keep-stores is given). Its policy can still be evaluated: dbr evaluate --policy ", root,
        "\nFor more training start a new run in another --run-dir."));
  }
  RETURN_IF_ERROR(MakeFolders({root}));
  return claim;
}

absl::Status FolderClaim::PutConfig(const Config& config) {
  RemoveNextConfig();  // of a launch that was killed
  config_text_ = PrintConfig(config);
  const absl::StatusOr<std::string> before = ReadFile(folder_.config());
  if (!is_new_ && before.ok() && *before == config_text_) return absl::OkStatus();
  if (!is_new_) config_path_ = NextConfig(folder_);
  return WriteFileAtomically(config_path_, config_text_);
}

void FolderClaim::RemoveNextConfig() {
  std::error_code none_there;
  fs::remove(NextConfig(folder_), none_there);
}

absl::Status FolderClaim::Begin() {
  begun_ = true;
  std::error_code none_there;
  fs::remove(ResultsPath(folder_), none_there);
  if (config_path_ == folder_.config()) return absl::OkStatus();
  // The other file stays until the launch ends, for processes that are started again read it.
  return WriteFileAtomically(folder_.config(), config_text_);
}

bool FolderClaim::IsStillThere() const {
  struct stat claimed, there;
  return fstat(lock_, &claimed) == 0 && stat(LockPath(folder_).c_str(), &there) == 0 &&
         claimed.st_ino == there.st_ino && claimed.st_dev == there.st_dev;
}

void FolderClaim::Withdraw() {
  if (begun_ || !is_new_) return;
  std::error_code error;
  for (const std::string& path :
       {folder_.replay_store(), folder_.checkpoints(), folder_.policies(), folder_.metrics()}) {
    fs::remove_all(path, error);
  }
  for (fs::directory_iterator entry(folder_.root, error), end; entry != end; entry.increment(error)) {
    if (IsEventFile(entry->path())) fs::remove(entry->path(), error);
  }
}

}  // namespace dbr
