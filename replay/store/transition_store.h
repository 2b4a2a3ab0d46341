// The rows of the replay: a slab of fixed stride that outlives its process where it lies in a file.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/transition.h"
#include "replay/store/seed_buffer_record.h"
#include "replay/store/store_counters.h"
#include "replay/store/store_file.h"
#include "replay/store/store_types.h"
#include "replay/store/writer_table.h"

namespace dbr {

// Rows enter at the newest end and leave at the oldest. Each has a key, counted from 1 and never used again.
// A store may be begun with a seed buffer of offline data, whose rows have the first keys; where it is
// pinned, its rows keep the first slots for good, and the slots behind them are a ring for the rows that come
// later. With capacity 8, a pinned seed buffer of 3 rows and 9 rows after it:
//
//              |  pinned   |          ring           |
//      slot      0   1   2   3    4    5    6    7
//      key       1   2   3   9   10   11   12    8      oldest_key() 8, next_key() 13
//      floats    stride floats in each slot, as core/transition.h lays them
//      labels    RowLabels in each slot
//
// So the slot of a key is arithmetic: key k <= pinned lies in slot k - 1, and key k > pinned in slot
// pinned + (k - 1 - pinned) % (capacity - pinned). Without a pinned seed buffer pinned is 0.
//
// In the file the sections follow one another, each at a multiple of 64 bytes, behind the header of
// StoreFile:
//
//   | counters | seed buffer record | last episodes | writers | keys and labels, by slot | floats, by slot |
//
// A row is committed by its key, which is written last, after the old one was struck out: a row torn by a
// kill has no key and is not there on reopening, and the one before it is the newest. Thread-compatible: the
// buffer's mutex guards it.
class TransitionStore {
 public:
  static constexpr std::uint64_t kRecentEpisodes = 1000;

  // Errors: InvalidArgument where capacity or budget makes no sense or is larger than the machine's memory,
  // and those of StoreFile::Open. O(capacity) with `resume`.
  static absl::StatusOr<std::unique_ptr<TransitionStore>> Open(const StoreOptions& options);

  // Requires size() < capacity(): the caller has called Evict where it was full. Returns the row's slot.
  std::uint32_t Append(const TransitionView& transition, const RowLabels& labels);
  void Evict();  // the oldest row that is not pinned; requires CanEvict()
  bool CanEvict() const { return ring_size_ > 0; }

  // Appends a row [stride] of the seed buffer and returns its slot. Requires that nothing else came before,
  // and size() < capacity().
  std::uint32_t AppendSeedBuffer(const float* row, const RowLabels& labels);
  // Says that the seed buffer is complete: stores `record`, with rows = seed_buffer_rows(), and pins all of
  // them with `pin`.
  void CompleteSeedBuffer(SeedBufferRecord record, bool pin);
  const SeedBufferRecord& seed_buffer() const { return *seed_buffer_; }  // zeros before CompleteSeedBuffer
  // Rows of the seed buffer that ever came in.
  std::uint64_t seed_buffer_rows() const { return seed_buffer_rows_; }

  bool Holds(std::uint64_t key) const {
    return (key >= oldest_key() && key < next_key_) || (key >= 1 && key <= pinned_);
  }
  // The slot of a key that the store holds, or may hold next.
  std::uint32_t SlotOf(std::uint64_t key) const {
    if (key <= pinned_) return static_cast<std::uint32_t>(key - 1);
    return static_cast<std::uint32_t>(pinned_ + (key - 1 - pinned_) % ring_);
  }
  // The key of the held row that `rank` held rows are older than; a pinned seed buffer's rows are the oldest.
  // Requires rank < size().
  std::uint64_t KeyAtRank(std::uint64_t rank) const {
    return rank < pinned_ ? rank + 1 : oldest_key() + (rank - pinned_);
  }
  std::uint64_t KeyAt(std::uint32_t slot) const { return metas_[slot].key; }
  const RowLabels& labels(std::uint32_t slot) const { return metas_[slot].labels; }
  // Changes a row's advantage, which a critic of `critic_version` gave.
  void SetAdvantage(std::uint32_t slot, float advantage, std::uint64_t critic_version);
  // The floats [stride] of a row.
  const float* row(std::uint32_t slot) const { return rows_ + std::size_t{slot} * stride_; }

  void CountEpisode(const EpisodeEnd& end);
  // The ends of the last kRecentEpisodes episodes, or of fewer where there were fewer, in no order that means
  // anything.
  const EpisodeEnd& recent_episode(std::uint64_t i) const { return episodes_[i % kRecentEpisodes]; }

  const TransitionLayout& layout() const { return layout_; }
  std::uint64_t capacity() const { return capacity_; }
  std::uint64_t size() const { return pinned_ + ring_size_; }
  std::uint64_t next_key() const { return next_key_; }
  std::uint64_t oldest_key() const { return next_key_ - ring_size_; }  // of the rows that are not pinned
  std::uint64_t inserted() const { return next_key_ - 1; }  // ever, the seed buffer's rows included
  std::uint64_t online_inserted() const { return inserted() - seed_buffer_rows_; }
  std::uint64_t bytes() const { return bytes_; }  // that rows, labels and indices need at capacity
  std::uint64_t torn() const { return torn_; }    // rows that reopening found incomplete
  StoreCounters& counters() { return *counters_; }
  const StoreCounters& counters() const { return *counters_; }
  WriterTable& writers() { return *writers_; }
  const WriterTable& writers() const { return *writers_; }

  // Writes all to disk, so that it outlives the machine too. Blocks. Errors of StoreFile::Sync.
  absl::Status Sync() { return file_->Sync(); }

 private:
  struct Meta {
    std::uint64_t key;  // 0: empty
    RowLabels labels;
  };

  TransitionStore(const TransitionLayout& layout, std::uint64_t capacity, std::unique_ptr<StoreFile> file);
  static std::size_t ContentBytes(std::uint64_t capacity, int stride);
  // Writes a row by `fill(float* row)` and commits it.
  template <class Fill>
  std::uint32_t Write(const RowLabels& labels, const Fill& fill);
  void Pin(std::uint64_t rows);
  absl::Status Recover();
  bool LooksWhole(std::uint64_t key) const;

  const TransitionLayout layout_;
  const int stride_;  // floats
  const std::uint64_t capacity_;
  const std::uint64_t bytes_;
  const std::unique_ptr<StoreFile> file_;
  StoreCounters* counters_;
  SeedBufferRecord* seed_buffer_;
  EpisodeEnd* episodes_;
  Meta* metas_;
  float* rows_;
  std::unique_ptr<WriterTable> writers_;
  std::uint64_t seed_buffer_rows_ = 0;
  std::uint64_t pinned_ = 0;
  std::uint64_t ring_;           // slots that are not pinned; 1 where all are, and then none is asked for
  std::uint64_t ring_size_ = 0;  // rows held in them
  std::uint64_t next_key_ = 1;
  std::uint64_t torn_ = 0;
};

}  // namespace dbr
