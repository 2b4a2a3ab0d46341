// The right of one launch to a run folder.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/run_folder.h"
#include "proto/config.pb.h"

namespace dbr {

// Whether a launch has its claim on the folder now. Takes nothing, so that a launch which starts meanwhile is
// not refused.
bool IsInUse(const RunFolder& folder);

// Whether there is anything that a launch could go on with: a store or a checkpoint.
bool HasBegun(const RunFolder& folder);

// A claim is given back when the object is destroyed, or by the kernel when the process dies.
//
// What stands in a folder that is claimed for a resume stays as it is until Begin(): the results and the
// config of the run are those of a run that may be finished, and that this launch may not be able to go on
// with. One thread.
class FolderClaim {
 public:
  // Makes the folder `root` for a new run and claims it. A folder is also free for it that is empty, or in
  // which an earlier launch failed before its run began. Errors: AlreadyExists where another run or other
  // files are in it; FailedPrecondition where another launch uses it; else why it cannot be made.
  static absl::StatusOr<std::unique_ptr<FolderClaim>> New(const std::string& root);

  // The same for the first free name of `root`, `root`-2, `root`-3 and so on: of two launches in one second
  // each gets its own.
  static absl::StatusOr<std::unique_ptr<FolderClaim>> NewOfName(const std::string& root);

  // Claims the folder of a run to go on with it, or to begin it where nothing has begun yet.
  // FailedPrecondition where another launch uses it, or the run has lost its replay store.
  static absl::StatusOr<std::unique_ptr<FolderClaim>> OfRun(const std::string& root);

  ~FolderClaim();
  FolderClaim(const FolderClaim&) = delete;
  FolderClaim& operator=(const FolderClaim&) = delete;

  const RunFolder& folder() const { return folder_; }
  // Whether the run has still to begin.
  bool is_new() const { return is_new_; }

  // Puts the config where the processes of this launch find it: config_path(). That is the folder's
  // config.textproto, or until Begin() a file beside it. Errors as WriteFileAtomically (core/file_io.h).
  absl::Status PutConfig(const Config& config);
  const std::string& config_path() const { return config_path_; }

  // The launch has come so far that the folder's run is its own: the config becomes the folder's, and the
  // results of the launch before are removed.
  absl::Status Begin();
  bool has_begun() const { return begun_; }

  // Whether the folder is still where it was claimed: it may be moved or removed meanwhile.
  bool IsStillThere() const;

  // The launch gives up, and its processes have ended. Where a new run has not begun, what they have put into
  // the folder is removed, but for logs and the config: the same command may start it again.
  void Withdraw();

 private:
  FolderClaim(RunFolder folder, int lock);
  static absl::StatusOr<std::unique_ptr<FolderClaim>> Take(const std::string& root);
  void RemoveNextConfig();

  const RunFolder folder_;
  const int lock_;  // file descriptor
  const bool is_new_;
  std::string config_path_;
  std::string config_text_;
  bool begun_ = false;
};

}  // namespace dbr
