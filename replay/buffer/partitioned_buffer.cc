#include "replay/buffer/partitioned_buffer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/status_macros.h"
#include "replay/buffer/row_check.h"

namespace dbr {
namespace {

// Sequence numbers beyond this are no writer's; it leaves room for sums.
constexpr std::uint64_t kMaxSequence = std::uint64_t{1} << 62;

absl::Status CheckBatch(const InsertBatch& batch) {
  if (batch.first_sequence < 1 || batch.first_sequence > kMaxSequence) {
    return absl::InvalidArgumentError(
        absl::StrCat("first_sequence: expected 1 to ", kMaxSequence, ", found ", batch.first_sequence));
  }
  int expected_from = 0;
  for (const RowEnd& end : batch.ends) {
    if (end.row < expected_from || end.row >= batch.columns.count) {
      return absl::InvalidArgumentError(absl::StrCat("episode_ends: expected ascending rows from ",
                                                     expected_from, " to ", batch.columns.count - 1,
                                                     ", found ", end.row));
    }
    expected_from = end.row + 1;
  }
  return absl::OkStatus();
}

absl::Status CheckCount(const char* what, std::uint64_t found, std::uint64_t max) {
  if (found <= max) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(what, ": expected at most ", max, " in one call, found ", found));
}

}  // namespace

absl::StatusOr<std::unique_ptr<PartitionedBuffer>> PartitionedBuffer::Make(
    std::unique_ptr<TransitionStore> store, const BufferOptions& options) {
  ASSIGN_OR_RETURN(const RateLimiter limiter, RateLimiter::Make(options.limiter, store->capacity()));
  Partitions partitions(static_cast<std::uint32_t>(store->capacity()));
  for (std::uint64_t rank = 0; rank < store->size(); ++rank) {
    const std::uint32_t slot = store->SlotOf(store->KeyAtRank(rank));
    partitions.Add(slot, store->labels(slot).advantage, store->labels(slot).source);
  }
  return std::unique_ptr<PartitionedBuffer>(
      new PartitionedBuffer(std::move(store), options, limiter, std::move(partitions)));
}

PartitionedBuffer::PartitionedBuffer(std::unique_ptr<TransitionStore> store, const BufferOptions& options,
                                     const RateLimiter& limiter, Partitions partitions)
    : layout_(store->layout()),
      capacity_(store->capacity()),
      cumulative_advantage_(options.cumulative_advantage),
      seed_buffer_share_(options.seed_buffer_share),
      now_(options.now),
      start_(options.now()),
      store_(std::move(store)),
      partitions_(std::move(partitions)),
      limiter_(limiter),
      rng_(options.seed),
      inserts_(start_),
      draws_(start_),
      relabels_(start_) {}

absl::StatusOr<std::uint32_t> PartitionedBuffer::OpenWriter(const WriterIdentity& identity) {
  absl::MutexLock lock(&mutex_);
  if (closed_) return absl::UnavailableError("the replay server is stopping");
  return store_->writers().Open(identity);
}

void PartitionedBuffer::CloseWriter(std::uint32_t place) {
  absl::MutexLock lock(&mutex_);
  store_->writers().Close(place);
}

WriterProgress PartitionedBuffer::Progress(std::uint32_t place) const {
  absl::MutexLock lock(&mutex_);
  const WriterRecord& record = store_->writers().record(place);
  return {record.last_sequence, record.refused};
}

bool PartitionedBuffer::SkipRows(std::uint32_t place, const std::vector<bool>& refused, InsertBatch* batch) {
  WriterRecord& writer = store_->writers().record(place);
  for (; batch->next_row < batch->columns.count; ++batch->next_row) {
    const std::uint64_t sequence = batch->first_sequence + static_cast<std::uint64_t>(batch->next_row);
    if (sequence <= writer.last_sequence) {
      ++writer.duplicates;
      ++store_->counters().duplicates;
    } else if (!refused.empty() && refused[static_cast<std::size_t>(batch->next_row)]) {
      ++writer.refused;
      ++store_->counters().refused;
      writer.last_sequence = sequence;
    } else {
      return true;
    }
  }
  return false;
}

void PartitionedBuffer::Evict() {
  const std::uint32_t slot = store_->SlotOf(store_->oldest_key());
  const RowLabels& labels = store_->labels(slot);
  partitions_.Remove(slot, labels.advantage, labels.source);
  store_->writers().AddHeld(labels.writer, -1);
  store_->Evict();
}

void PartitionedBuffer::InsertRow(std::uint32_t place, const InsertBatch& batch) {
  if (store_->size() == capacity_) Evict();
  const int row = batch.next_row;
  WriterRecord& writer = store_->writers().record(place);
  RowLabels labels{.sequence = batch.first_sequence + static_cast<std::uint64_t>(row),
                   .critic_version = batch.columns.CriticVersion(row),
                   .advantage = batch.columns.Advantage(row),
                   .writer = place,
                   .source = writer.source};
  const std::uint32_t slot = store_->Append(batch.columns.Row(layout_, row), labels);
  partitions_.Add(slot, labels.advantage, labels.source);
  store_->writers().AddHeld(place, 1);
  writer.last_sequence = labels.sequence;
  ++writer.inserted;
  if (!std::isnan(labels.advantage)) {
    store_->counters().newest_label = std::max(store_->counters().newest_label, labels.critic_version);
  }
}

absl::Status PartitionedBuffer::Insert(std::uint32_t place, InsertBatch* batch, absl::Time deadline) {
  RETURN_IF_ERROR(CheckBatch(*batch));
  const std::vector<bool> refused = RefusedRows(layout_, batch->columns);
  const absl::Time now = now_();
  auto end = std::lower_bound(batch->ends.begin(), batch->ends.end(), batch->next_row,
                              [](const RowEnd& e, int row) { return e.row < row; });
  while (batch->next_row < batch->columns.count) {
    absl::MutexLock lock(&mutex_);
    RETURN_IF_ERROR(CheckHasPlace());
    const std::uint64_t inserted_before = store_->inserted();
    for (int rows = 0; rows < kRowsPerLock && SkipRows(place, refused, batch); ++rows) {
      if (rows > 0 && !CanInsert()) break;
      if (rows == 0) RETURN_IF_ERROR(AwaitInsert(deadline));
      // While this one waited, another stream of the writer may have brought the same rows.
      if (rows == 0 && !SkipRows(place, refused, batch)) break;
      InsertRow(place, *batch);
      while (end != batch->ends.end() && end->row < batch->next_row) ++end;
      if (end != batch->ends.end() && end->row == batch->next_row) store_->CountEpisode(end->end);
      ++batch->next_row;
    }
    inserts_.Add(now, store_->inserted() - inserted_before);
  }
  return absl::OkStatus();
}

void PartitionedBuffer::DrawPart(int part, std::uint32_t count, const DrawColumns& out) {
  ChooseSlots(part, count);
  const ColumnSet<ColumnPlace> places = layout_.columns();
  constexpr std::size_t kAhead = 8;  // rows lie at random: ask for them before they are needed
  for (std::size_t i = 0; i < count; ++i) {
    if (i + kAhead < count) __builtin_prefetch(store_->row(drawn_slots_[i + kAhead]));
    const float* row = store_->row(drawn_slots_[i]);
    out.keys[i] = store_->KeyAt(drawn_slots_[i]);
    ForEachColumn(
        [row, i](const ColumnPlace& place, float* column) {
          const auto width = static_cast<std::size_t>(place.width);
          if (width > 0) std::memcpy(column + i * width, row + place.offset, width * sizeof(float));
        },
        places, out);
  }
}

absl::Status PartitionedBuffer::Draw(const DrawRequest& request, const DrawBuffers& out, absl::Time deadline,
                                     DrawResult* result) {
  std::uint64_t asked = 0;
  for (const std::uint32_t count : request.counts) asked += count;
  if (asked == 0)
    return absl::InvalidArgumentError("sample: expected at least one transition to draw, found 0");
  RETURN_IF_ERROR(CheckCount("sample: transitions to draw", asked, kMaxDraws));
  absl::MutexLock lock(&mutex_);
  result->raised_tolerance = limiter_.MakeRoomFor(asked) ? limiter_.options().tolerance : 0;
  RETURN_IF_ERROR(AwaitDraw(request, deadline));
  std::uint64_t drawn = 0;
  for (int part = 0; part < kDrawnParts; ++part) {
    result->drawn[part] = partitions_.size(part) > 0 ? request.counts[part] : 0;
    DrawPart(part, result->drawn[part], out[part]);
    drawn += result->drawn[part];
  }
  store_->counters().sampled += drawn;
  if (store_->online_inserted() == 0) store_->counters().sampled_offline += drawn;
  draws_.Add(now_(), drawn);
  result->total = partitions_.size(kAll);
  result->plus = partitions_.size(kPlus);
  result->minus = partitions_.size(kMinus);
  result->unjudged = partitions_.size(kUnjudgedPart);
  result->inserted = store_->online_inserted();
  result->episodes = store_->counters().episodes;
  return absl::OkStatus();
}

absl::StatusOr<RelabelResult> PartitionedBuffer::Relabel(std::uint64_t version,
                                                         absl::Span<const std::uint64_t> keys,
                                                         absl::Span<const float> advantages) {
  if (keys.size() != advantages.size()) {
    return absl::InvalidArgumentError(absl::StrCat("relabel: expected one advantage for each key, found ",
                                                   keys.size(), " keys and ", advantages.size(),
                                                   " advantages"));
  }
  RETURN_IF_ERROR(CheckCount("relabel: keys", keys.size(), kMaxRelabels));
  RelabelResult result;
  const absl::Time now = now_();
  absl::MutexLock lock(&mutex_);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (!std::isfinite(advantages[i])) {
      ++result.refused;
    } else if (!store_->Holds(keys[i])) {
      ++result.evicted;
    } else if (const std::uint32_t slot = store_->SlotOf(keys[i]);
               store_->labels(slot).critic_version > version) {
      ++result.stale;
    } else {
      RelabelRow(slot, version, advantages[i]);
      ++result.relabelled;
    }
  }
  StoreCounters& counters = store_->counters();
  counters.relabelled += result.relabelled;
  counters.relabel_evicted += result.evicted;
  counters.relabel_stale += result.stale;
  counters.relabel_refused += result.refused;
  if (result.relabelled > 0) counters.newest_label = std::max(counters.newest_label, version);
  relabels_.Add(now, result.relabelled);
  return result;
}

void PartitionedBuffer::RelabelRow(std::uint32_t slot, std::uint64_t version, float advantage) {
  const RowLabels before = store_->labels(slot);
  if (cumulative_advantage_ && before.advantage > 0)
    advantage += before.advantage;  // not yet judged (NaN): nothing to add
  if (std::isinf(advantage)) advantage = std::numeric_limits<float>::max();
  store_->SetAdvantage(slot, advantage, version);
  partitions_.Relabel(slot, before.advantage, advantage, before.source);
}

void PartitionedBuffer::Close() {
  absl::MutexLock lock(&mutex_);
  closed_ = true;
}

// Without the lock: it reads nothing but where the mapping lies, and waits for the disk.
absl::Status PartitionedBuffer::Sync() ABSL_NO_THREAD_SAFETY_ANALYSIS {
  return store_->Sync();
}

}  // namespace dbr
