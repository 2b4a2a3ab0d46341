// What the replay buffer counts and says of itself.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/time/time.h"
#include "replay/buffer/buffer_stats.h"
#include "replay/buffer/partitions.h"
#include "replay/buffer/rate_window.h"
#include "replay/store/transition_store.h"

namespace dbr {

// The rates of a buffer's calls, and its counts, writers and episodes as the store and the partitions have
// them. Changes neither. Thread-compatible: the buffer's mutex guards it, with the store and the partitions;
// time comes from the caller.
class BufferStatistics {
 public:
  // `start`: of the buffer. `store` and `partitions` are not owned and outlive this.
  BufferStatistics(absl::Time start, const TransitionStore* store, const Partitions* partitions);

  // Rows that a call has inserted, drawn or relabelled at `now`. O(1).
  void CountInserted(absl::Time now, std::uint64_t rows) { inserts_.Add(now, rows); }
  void CountDrawn(absl::Time now, std::uint64_t rows) { draws_.Add(now, rows); }
  void CountRelabelled(absl::Time now, std::uint64_t rows) { relabels_.Add(now, rows); }

  // All but `labels` (LabelSurvey) and `blocked` (Admission::Blocked). O(places of the writer table).
  BufferStats Gather(absl::Time now) const;

 private:
  void AddCounts(BufferStats* stats) const;
  void AddWriters(BufferStats* stats) const;
  void AddEpisodes(BufferStats* stats) const;

  const absl::Time start_;
  const TransitionStore& store_;
  const Partitions& partitions_;
  RateWindow inserts_, draws_, relabels_;
};

// Looks at the labels of rows spread evenly over a store, a thousand at a time, so that who holds the store's
// lock for it never holds it for long:
//
//   LabelSurvey survey(20000);
//   while (survey.LookOn(store)) { }     the lock may be released between calls
//   survey.Summarize();                  without the lock
//
// Rows that come after the first call are not looked at, those evicted meanwhile give way to newer ones.
class LabelSurvey {
 public:
  explicit LabelSurvey(std::uint64_t most_rows) : most_rows_(most_rows) {}

  // Looks at the next rows; false where none is left.
  bool LookOn(const TransitionStore& store);
  // Consumes what was seen. O(rows looked at).
  LabelSummary Summarize();

 private:
  const std::uint64_t most_rows_;
  std::uint64_t rows_ = 0;  // held by the store at the first look
  std::uint64_t step_ = 0;  // between the ranks of two rows that are looked at; 0 before the first look
  std::uint64_t rank_ = 0;  // of the next one
  std::vector<float> advantages_;
  std::vector<std::uint64_t> ages_;  // critic versions behind the newest label
};

}  // namespace dbr
