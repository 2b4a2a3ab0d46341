// The statistics of the replay buffer, as plain values.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "replay/store/seed_buffer_record.h"
#include "replay/store/store_counters.h"
#include "replay/store/writer_table.h"

namespace dbr {

// One writer, known by its id.
struct WriterSummary {
  WriterIdentity identity;
  std::uint64_t inserted = 0;       // rows that came from it, in all
  std::uint64_t last_sequence = 0;  // the highest sequence number that it used
  std::uint64_t duplicates = 0;     // rows that it sent again and that were dropped
  std::uint64_t refused = 0;        // rows that row_check.h refused
  std::uint64_t held = 0;           // rows of it that the buffer still holds
  bool connected = false;           // it has a stream open
};

// The calls of one kind that wait.
struct BlockedCalls {
  std::string call;           // "insert" or "sample"
  std::uint64_t clients = 0;  // how many wait
  std::string why;            // a sentence for people
};

// The labels of a sample of the judged rows.
struct LabelSummary {
  double age_mean = 0;  // critic versions behind the newest label
  double age_p95 = 0;
  // histogram[i] counts advantages in [edges[i], edges[i + 1]); the edges are symmetric about 0.
  std::vector<double> edges;
  std::vector<std::uint64_t> histogram;
};

// Summarizes the advantages of n judged rows, and their ages in critic versions. Consumes the ages. O(n).
LabelSummary SummarizeLabels(const std::vector<float>& advantages, std::vector<std::uint64_t> ages);

// All statistics of a buffer at one time. Counts are rows unless they say otherwise.
struct BufferStats {
  std::uint64_t total = 0, plus = 0, minus = 0, unjudged = 0;  // held in D, D+, D-, not judged
  std::uint64_t seed_buffer = 0, seed_buffer_plus = 0, seed_buffer_minus = 0;  // of these, the seed buffer's
  std::uint64_t capacity = 0;
  std::uint64_t bytes = 0;     // of rows, labels and indices, at capacity
  std::uint64_t inserted = 0;  // without the seed buffer
  std::uint64_t evicted = 0;
  std::uint64_t seed_buffer_rows = 0;  // of the seed buffer that ever came in
  SeedBufferRecord seed_buffer_record{};
  StoreCounters counters{};
  // Rows drawn for each row inserted, over the life of the buffer. The seed buffer's rows, and what was drawn
  // while there were no others, do not count.
  double samples_per_insert = 0;
  double insert_rate = 0, sample_rate = 0, relabel_rate = 0;  // rows a second, over the last seconds
  LabelSummary labels;  // of at most PartitionedBuffer::kLabelsLookedAt rows, spread evenly over the buffer
  std::vector<WriterSummary> writers;
  std::vector<BlockedCalls> blocked;
  // Means over the last TransitionStore::kRecentEpisodes episodes: the undiscounted return, the score (0 to
  // 1) and the length in steps. NaN before the first episode, and the score where the environment has none.
  double recent_return_mean = 0, recent_score_mean = 0, recent_length_mean = 0;
  double uptime_s = 0;
};

}  // namespace dbr
