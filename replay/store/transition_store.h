// The rows of the replay: a ring of fixed stride that outlives its process where it lies in a file.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/transition.h"
#include "replay/store/seed_buffer_record.h"
#include "replay/store/store_counters.h"
#include "replay/store/store_file.h"
#include "replay/store/writer_table.h"

namespace dbr {

struct StoreOptions {
  std::string path;  // empty: memory alone
  std::string env;   // whose transitions these are
  TransitionLayout layout;
  std::uint64_t capacity = 0;      // rows
  std::uint64_t byte_budget = 0;   // of all that a row needs, indices included; 0: what the capacity needs
  bool resume = false;             // continue the file at `path`
  std::uint64_t memory_bytes = 0;  // of the machine; 0: asks the system
};

// What a row carries beside its floats.
struct RowLabels {
  std::uint64_t sequence = 0;
  std::uint64_t critic_version = 0;  // of the advantage
  float advantage = kUnjudged;
  std::uint32_t writer = 0;  // place in the table of writers
  Source source = Source::kOnline;
};

// Rows enter at the newest end and leave at the oldest. Each has a key, counted from 1 and never used again,
// so that the slot of a key is arithmetic. A store may be begun with a seed buffer of offline data, which has
// the first keys; where it is pinned it stays in the first slots, and the others are a ring for what comes
// later: the held keys are [1, pinned] and [oldest_key, next_key), and key k > pinned lies in slot pinned +
// (k - 1 - pinned) % (capacity - pinned). As long as nothing was evicted key k lies in slot k - 1, pinned or
// not.
//
// A row in a file is committed by its key, written last, after the old key was struck out: a row torn by a
// kill has no key and is not there on reopening, and the one before it is the newest. Thread-compatible: the
// buffer's lock guards it.
class TransitionStore {
 public:
  static constexpr std::uint64_t kRecentEpisodes = 1000;

  // Errors: InvalidArgument where capacity or budget make no sense or are larger than the machine's memory,
  // and those of StoreFile::Open. O(capacity) with `resume`.
  static absl::StatusOr<std::unique_ptr<TransitionStore>> Open(const StoreOptions& options);

  // Requires size() < capacity(): the caller has called Evict where it was full. Returns the row's slot.
  std::uint32_t Append(const TransitionView& transition, const RowLabels& labels);
  void Evict();  // the oldest row that is not pinned; requires CanEvict()
  bool CanEvict() const { return ring_size_ > 0; }

  // Appends a row of the seed buffer, flat as layout() says. Requires that nothing else came before, and
  // size() < capacity().
  std::uint32_t AppendSeedBuffer(const float* row, const RowLabels& labels);
  // Ends the seed buffer: writes down `record`, with rows = seed_buffer_rows(), and pins all of them where
  // asked.
  void CompleteSeedBuffer(SeedBufferRecord record, bool pin);
  const SeedBufferRecord& seed_buffer() const { return *seed_buffer_; }  // zeros before CompleteSeedBuffer
  std::uint64_t seed_buffer_rows() const { return seed_buffer_rows_; }   // that ever came in
  std::uint64_t seed_buffer_held() const {
    return pinned_ > 0 ? pinned_ : seed_buffer_rows_ - std::min(seed_buffer_rows_, oldest_key() - 1);
  }

  bool Holds(std::uint64_t key) const {
    return (key >= oldest_key() && key < next_key_) || (key >= 1 && key <= pinned_);
  }
  // Of a key that the store holds, or may hold next.
  std::uint32_t SlotOf(std::uint64_t key) const {
    if (key <= pinned_) return static_cast<std::uint32_t>(key - 1);
    return static_cast<std::uint32_t>(pinned_ + (key - 1 - pinned_) % ring_);
  }
  // Key of the held row that `rank` held rows are older than; the seed buffer's rows come first. rank <
  // size().
  std::uint64_t KeyAtRank(std::uint64_t rank) const {
    return rank < pinned_ ? rank + 1 : oldest_key() + (rank - pinned_);
  }
  std::uint64_t KeyAt(std::uint32_t slot) const { return metas_[slot].key; }
  const RowLabels& labels(std::uint32_t slot) const { return metas_[slot].labels; }
  void SetAdvantage(std::uint32_t slot, float advantage, std::uint64_t critic_version);
  const float* row(std::uint32_t slot) const { return rows_ + std::size_t{slot} * stride_; }

  void CountEpisode(const EpisodeEnd& end);
  const EpisodeEnd& recent_episode(std::uint64_t i) const { return episodes_[i % kRecentEpisodes]; }

  const TransitionLayout& layout() const { return layout_; }
  std::uint64_t capacity() const { return capacity_; }
  std::uint64_t size() const { return pinned_ + ring_size_; }
  std::uint64_t next_key() const { return next_key_; }
  std::uint64_t oldest_key() const { return next_key_ - ring_size_; }  // that is not pinned
  std::uint64_t inserted() const { return next_key_ - 1; }             // seed buffer included
  std::uint64_t online_inserted() const { return inserted() - seed_buffer_rows_; }
  std::uint64_t bytes() const { return bytes_; }  // of rows, labels and indices, at capacity
  std::uint64_t torn() const { return torn_; }    // rows that reopening found incomplete
  StoreCounters& counters() { return *counters_; }
  const StoreCounters& counters() const { return *counters_; }
  WriterTable& writers() { return *writers_; }
  const WriterTable& writers() const { return *writers_; }

  // Writes all to disk, so that it outlives the machine too. Blocks.
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
