// Output that nobody has to read in time.
#pragma once

#include <cstdint>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/strings/string_view.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"

namespace dbr {

// Takes text at once, whatever becomes of it, and writes it from a thread of its own: a reader that stalls (a
// pager, a terminal stopped by Ctrl-S, a program that has hung) holds up nobody but itself. Text that cannot
// be written (a full disk, a pipe that was closed) is dropped. For commands whose work is elsewhere; a
// command whose output is its result uses stdout. Thread-safe.
class Output {
 public:
  // `fd` must stay open. The thread takes no signals.
  explicit Output(int fd);
  // Gives the reader `kPatience` to take what it has not taken yet.
  ~Output();
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  // Does not block. Past `kMostBytes` that wait for their reader, text is dropped, and a line says so when
  // the reader goes on.
  void Write(absl::string_view text);

  // Whether so much text waits that the reader has stalled: text that will come anew can be left out.
  bool behind() const;

  int fd() const { return fd_; }

  static constexpr absl::Duration kPatience = absl::Seconds(3);
  static constexpr std::size_t kMostBytes = 1 << 20;

 private:
  void Run();
  void TellOfDropped() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Writes one piece; false where it could not be written, now or ever.
  bool WritePiece(absl::string_view piece);
  bool HasWork() const ABSL_SHARED_LOCKS_REQUIRED(mutex_) { return stopping_ || !pending_.empty(); }
  bool AllWritten() const ABSL_SHARED_LOCKS_REQUIRED(mutex_) { return pending_.empty(); }

  const int fd_;
  const int write_fd_;  // never blocks, where that can be had; -1: fd_ is written to
  const int stop_fd_;
  mutable absl::Mutex mutex_;
  std::string pending_ ABSL_GUARDED_BY(mutex_);
  std::uint64_t dropped_ ABSL_GUARDED_BY(mutex_) = 0;  // texts, since the last note of it
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace dbr
