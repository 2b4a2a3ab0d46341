// What the buffer can say of itself.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "replay/store/seed_buffer_record.h"
#include "replay/store/store_counters.h"
#include "replay/store/writer_table.h"

namespace dbr {

struct WriterSummary {
  WriterIdentity identity;
  std::uint64_t inserted = 0, last_sequence = 0, duplicates = 0, refused = 0, held = 0;
  bool connected = false;
};

struct BlockedCalls {
  std::string call;  // insert or sample
  std::uint64_t clients = 0;
  std::string why;
};

// The labels of some rows, and what they say of all.
struct LabelSummary {
  double age_mean = 0;  // critic versions behind the newest label
  double age_p95 = 0;
  // histogram[i] counts advantages in [edges[i], edges[i + 1]); the edges are symmetric about 0.
  std::vector<double> edges;
  std::vector<std::uint64_t> histogram;
};

// `advantages` and `ages` of the judged rows that were looked at; both are consumed. O(n).
LabelSummary SummarizeLabels(std::vector<float> advantages, std::vector<std::uint64_t> ages);

struct BufferStats {
  std::uint64_t total = 0, plus = 0, minus = 0, unjudged = 0;
  std::uint64_t seed_buffer = 0, seed_buffer_plus = 0, seed_buffer_minus = 0;
  std::uint64_t capacity = 0, bytes = 0;
  std::uint64_t inserted = 0;  // without the seed buffer
  std::uint64_t evicted = 0;
  std::uint64_t seed_buffer_rows = 0;  // that ever came in
  SeedBufferRecord seed_buffer_record{};
  StoreCounters counters{};
  double samples_per_insert =
      0;  // over the life of the buffer; the seed buffer, and draws from it alone, apart
  double insert_rate = 0, sample_rate = 0, relabel_rate = 0;  // a second, over the last seconds
  LabelSummary labels;  // of at most PartitionedBuffer::kLabelsLookedAt rows, evenly spread over the buffer
  std::vector<WriterSummary> writers;
  std::vector<BlockedCalls> blocked;
  // Over the last TransitionStore::kRecentEpisodes; NaN before the first episode, and the score where there
  // is none.
  double recent_return_mean = 0, recent_score_mean = 0, recent_length_mean = 0;
  double uptime_s = 0;
};

}  // namespace dbr
