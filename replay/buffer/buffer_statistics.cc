#include "replay/buffer/buffer_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "replay/buffer/admission.h"

namespace dbr {

BufferStatistics::BufferStatistics(absl::Time start, const TransitionStore* store,
                                   const Partitions* partitions)
    : start_(start),
      store_(*store),
      partitions_(*partitions),
      inserts_(start),
      draws_(start),
      relabels_(start) {}

BufferStats BufferStatistics::Gather(absl::Time now) const {
  BufferStats stats;
  stats.uptime_s = absl::ToDoubleSeconds(now - start_);
  AddCounts(&stats);
  AddWriters(&stats);
  AddEpisodes(&stats);
  stats.insert_rate = inserts_.PerSecond(now);
  stats.sample_rate = draws_.PerSecond(now);
  stats.relabel_rate = relabels_.PerSecond(now);
  return stats;
}

void BufferStatistics::AddCounts(BufferStats* stats) const {
  stats->total = partitions_.size(kAll);
  stats->plus = partitions_.size(kPlus);
  stats->minus = partitions_.size(kMinus);
  stats->unjudged = partitions_.size(kUnjudgedPart);
  stats->seed_buffer = partitions_.seed_buffer(kAll);
  stats->seed_buffer_plus = partitions_.seed_buffer(kPlus);
  stats->seed_buffer_minus = partitions_.seed_buffer(kMinus);
  stats->capacity = store_.capacity();
  stats->bytes = store_.bytes();
  stats->inserted = store_.online_inserted();
  stats->evicted = store_.inserted() - store_.size();
  stats->counters = store_.counters();
  stats->seed_buffer_rows = store_.seed_buffer_rows();
  stats->seed_buffer_record = store_.seed_buffer();
  const RateLimiter::Counts counts = CountsOf(store_);
  if (counts.inserted > 0)
    stats->samples_per_insert = static_cast<double>(counts.sampled) / static_cast<double>(counts.inserted);
}

void BufferStatistics::AddWriters(BufferStats* stats) const {
  const WriterTable& writers = store_.writers();
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

void BufferStatistics::AddEpisodes(BufferStats* stats) const {
  const std::uint64_t count = std::min(store_.counters().episodes, TransitionStore::kRecentEpisodes);
  double returns = 0, scores = 0, lengths = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const EpisodeEnd& end = store_.recent_episode(i);
    returns += end.episode_return;
    scores += end.score;
    lengths += end.length;
  }
  const double n = count > 0 ? static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
  stats->recent_return_mean = returns / n;
  stats->recent_score_mean = scores / n;
  stats->recent_length_mean = lengths / n;
}

bool LabelSurvey::LookOn(const TransitionStore& store) {
  constexpr std::uint64_t kRowsPerLook = 1000;
  if (step_ == 0) {
    rows_ = store.size();
    step_ = std::max<std::uint64_t>(1, (rows_ + most_rows_ - 1) / most_rows_);
    advantages_.reserve(rows_ / step_ + 1);
    ages_.reserve(rows_ / step_ + 1);
  }
  const std::uint64_t newest_label = store.counters().newest_label;
  for (std::uint64_t looked = 0; looked < kRowsPerLook && rank_ < rows_; ++looked, rank_ += step_) {
    const RowLabels& labels = store.labels(store.SlotOf(store.KeyAtRank(rank_)));
    if (std::isnan(labels.advantage)) continue;
    advantages_.push_back(labels.advantage);
    ages_.push_back(newest_label - std::min(labels.critic_version, newest_label));
  }
  return rank_ < rows_;
}

LabelSummary LabelSurvey::Summarize() {
  return SummarizeLabels(advantages_, std::move(ages_));
}

}  // namespace dbr
