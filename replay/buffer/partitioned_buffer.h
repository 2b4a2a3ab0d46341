// The replay buffer: D with its partitions D+ (advantage >= 0), D- (advantage <= 0) and the rows that no
// critic has judged yet.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "absl/types/span.h"
#include "replay/buffer/admission.h"
#include "replay/buffer/buffer_statistics.h"
#include "replay/buffer/buffer_stats.h"
#include "replay/buffer/buffer_types.h"
#include "replay/buffer/partitioned_rows.h"
#include "replay/buffer/rate_limiter.h"
#include "replay/buffer/row_drawer.h"
#include "replay/store/transition_store.h"

namespace dbr {

// The calls of the replay, under the one lock of the server:
//
//   Insert, InsertSeedBuffer, Relabel ---> PartitionedRows    the rows and their partitions, kept in step
//   Insert, Draw (wait) -----------------> Admission          the rate limiter and who waits
//   Draw --------------------------------> RowDrawer          random rows
//   Stats -------------------------------> BufferStatistics   counts and rates
//
// Thread-safe. The lock is held for at most kRowsPerLock inserted rows, one draw or one relabel. Rows are
// evicted first in, first out; a seed buffer may be pinned, and then the oldest of the others goes. An
// advantage of 0 lies in D+ and in D-.
class PartitionedBuffer {
 public:
  static constexpr int kRowsPerLock = 256;
  static constexpr int kSeedBufferRowsPerLock = 4096;
  static constexpr std::uint64_t kMaxDraws = 1 << 18;     // in one call
  static constexpr std::uint64_t kMaxRelabels = 1 << 18;  // in one call
  static constexpr std::uint64_t kLabelsLookedAt = 20000;

  // Takes the rows that the store has. InvalidArgument for options that make no sense. O(size).
  static absl::StatusOr<std::unique_ptr<PartitionedBuffer>> Make(std::unique_ptr<TransitionStore> store,
                                                                 const BufferOptions& options);

  // Opens a stream of a writer and returns its place, which Insert takes and CloseWriter ends. Unavailable
  // after Close; else errors of WriterTable::Open.
  absl::StatusOr<std::uint32_t> OpenWriter(const WriterIdentity& identity);
  void CloseWriter(std::uint32_t place);
  WriterProgress Progress(std::uint32_t place) const;  // of a writer with an open stream

  // Stores `batch` row by row as the limiter admits, and moves batch->next_row along. Sequence numbers that
  // the writer has used are dropped as duplicates; rows with a non-finite value, an infinite advantage or a
  // discrete action that is none are refused; both are counted by writer. Blocks until the limiter admits.
  // DeadlineExceeded, naming limiter, counters and bounds (what is stored stays, call again to go on);
  // Unavailable after Close; InvalidArgument for sequence numbers or ends that make no sense, and where a
  // pinned seed buffer has every place.
  absl::Status Insert(std::uint32_t place, InsertBatch* batch, absl::Time deadline);

  // Appends rows [n x stride] of the seed buffer, as core/transition.h lays them, not yet judged. The limiter
  // neither holds nor counts them. InvalidArgument where they are more than fit; FailedPrecondition once
  // something else has been inserted, or after CompleteSeedBuffer; Unavailable after Close.
  absl::Status InsertSeedBuffer(absl::Span<const float> rows);
  // Says that the seed buffer is complete and stores `record`, whose counts of rows the store fills in. With
  // `pin` none of its rows is ever evicted. Errors: FailedPrecondition and Unavailable as InsertSeedBuffer's.
  absl::Status CompleteSeedBuffer(const SeedBufferRecord& record, bool pin);

  // Draws with replacement into `out`, all parts under one snapshot. Blocks until the limiter admits and,
  // unless they may be empty, the asked partitions have something. Errors: DeadlineExceeded, naming what it
  // waited for; Unavailable after Close; InvalidArgument for no or too many draws. Sets
  // result->raised_tolerance even where it fails.
  absl::Status Draw(const DrawRequest& request, const DrawBuffers& out, absl::Time deadline,
                    DrawResult* result);

  // Sets the advantages of the rows `keys` [n], given by a critic of `version`, all under one lock. An older
  // version never overwrites a newer one. InvalidArgument where the two lengths differ or there are too many.
  absl::StatusOr<RelabelResult> Relabel(std::uint64_t version, absl::Span<const std::uint64_t> keys,
                                        absl::Span<const float> advantages);

  // Looks at the labels of no more than kLabelsLookedAt rows and never holds the lock for long: the parts of
  // the answer may be some milliseconds apart.
  BufferStats Stats() const;

  // Ends all waits with Unavailable and refuses later inserts and draws.
  void Close();
  // Writes the store to disk. Blocks until it is there. Errors of TransitionStore::Sync.
  absl::Status Sync();

  const TransitionLayout& layout() const { return layout_; }
  std::uint64_t capacity() const { return capacity_; }

 private:
  PartitionedBuffer(std::unique_ptr<TransitionStore> store, const BufferOptions& options,
                    const RateLimiter& limiter);

  // Drops or refuses the next rows where they are not to be stored; false where none is left.
  bool SkipRows(std::uint32_t place, const std::vector<bool>& refused, InsertBatch* batch)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckSeedBufferMayCome() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void RelabelRow(std::uint32_t slot, std::uint64_t version, float advantage)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const TransitionLayout layout_;
  const std::uint64_t capacity_;
  const bool cumulative_advantage_;
  const std::function<absl::Time()> now_;

  mutable absl::Mutex mutex_;
  const std::unique_ptr<TransitionStore> store_ ABSL_PT_GUARDED_BY(mutex_);
  PartitionedRows rows_ ABSL_GUARDED_BY(mutex_);
  Admission admission_ ABSL_GUARDED_BY(mutex_);
  RowDrawer drawer_ ABSL_GUARDED_BY(mutex_);
  BufferStatistics statistics_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace dbr
