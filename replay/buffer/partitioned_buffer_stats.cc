// What PartitionedBuffer::Stats gathers.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "replay/buffer/partitioned_buffer.h"

namespace dbr {

BufferStats PartitionedBuffer::Stats() const {
  BufferStats stats;
  stats.labels = LookAtLabels();
  const absl::Time now = now_();
  stats.uptime_s = absl::ToDoubleSeconds(now - start_);
  stats.capacity = capacity_;
  absl::MutexLock lock(&mutex_);
  AddCounts(&stats);
  AddWriters(&stats);
  AddBlocked(&stats);
  AddEpisodes(&stats);
  stats.insert_rate = inserts_.PerSecond(now);
  stats.sample_rate = draws_.PerSecond(now);
  stats.relabel_rate = relabels_.PerSecond(now);
  return stats;
}

void PartitionedBuffer::AddCounts(BufferStats* stats) const {
  stats->total = partitions_.size(kAll);
  stats->plus = partitions_.size(kPlus);
  stats->minus = partitions_.size(kMinus);
  stats->unjudged = partitions_.size(kUnjudgedPart);
  stats->seed_buffer = partitions_.seed_buffer(kAll);
  stats->seed_buffer_plus = partitions_.seed_buffer(kPlus);
  stats->seed_buffer_minus = partitions_.seed_buffer(kMinus);
  stats->bytes = store_->bytes();
  stats->inserted = store_->online_inserted();
  stats->evicted = store_->inserted() - store_->size();
  stats->counters = store_->counters();
  stats->seed_buffer_rows = store_->seed_buffer_rows();
  stats->seed_buffer_record = store_->seed_buffer();
  const RateLimiter::Counts counts = Counts();
  if (counts.inserted > 0)
    stats->samples_per_insert = static_cast<double>(counts.sampled) / static_cast<double>(counts.inserted);
}

void PartitionedBuffer::AddWriters(BufferStats* stats) const {
  const WriterTable& writers = store_->writers();
  for (std::uint32_t place = 0; place < WriterTable::kPlaces; ++place) {
    const WriterRecord& record = writers.record(place);
    if (record.id == 0) continue;
    stats->writers.push_back({.identity = {record.id, record.name, record.source},
                              .inserted = record.inserted,
                              .last_sequence = record.last_sequence,
                              .duplicates = record.duplicates,
                              .refused = record.refused,
                              .held = writers.held(place),
                              .connected = writers.connected(place)});
  }
}

void PartitionedBuffer::AddEpisodes(BufferStats* stats) const {
  const std::uint64_t count = std::min(store_->counters().episodes, TransitionStore::kRecentEpisodes);
  double returns = 0, scores = 0, lengths = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const EpisodeEnd& end = store_->recent_episode(i);
    returns += end.episode_return;
    scores += end.score;
    lengths += end.length;
  }
  const double n = count > 0 ? static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
  stats->recent_return_mean = returns / n;
  stats->recent_score_mean = scores / n;
  stats->recent_length_mean = lengths / n;
}

LabelSummary PartitionedBuffer::LookAtLabels() const {
  constexpr std::uint64_t kRowsPerLook = 1000;
  std::vector<float> advantages;
  std::vector<std::uint64_t> ages;
  std::uint64_t rows, step;
  {
    absl::MutexLock lock(&mutex_);
    rows = store_->size();
    step = std::max<std::uint64_t>(1, (rows + kLabelsLookedAt - 1) / kLabelsLookedAt);
  }
  advantages.reserve(rows / step + 1);
  ages.reserve(rows / step + 1);
  for (std::uint64_t rank = 0; rank < rows;) {
    absl::MutexLock lock(&mutex_);
    for (std::uint64_t looked = 0; looked < kRowsPerLook && rank < rows; ++looked, rank += step) {
      const RowLabels& labels = store_->labels(store_->SlotOf(store_->KeyAtRank(rank)));
      if (std::isnan(labels.advantage)) continue;
      advantages.push_back(labels.advantage);
      ages.push_back(store_->counters().newest_label -
                     std::min(labels.critic_version, store_->counters().newest_label));
    }
  }
  return SummarizeLabels(std::move(advantages), std::move(ages));
}

}  // namespace dbr
