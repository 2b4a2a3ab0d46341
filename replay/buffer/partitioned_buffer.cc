#include "replay/buffer/partitioned_buffer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/status_macros.h"
#include "replay/buffer/row_check.h"

namespace dbr {
namespace {

// No writer has sequence numbers beyond this; it leaves room for sums.
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
  return std::unique_ptr<PartitionedBuffer>(new PartitionedBuffer(std::move(store), options, limiter));
}

PartitionedBuffer::PartitionedBuffer(std::unique_ptr<TransitionStore> store, const BufferOptions& options,
                                     const RateLimiter& limiter)
    : layout_(store->layout()),
      capacity_(store->capacity()),
      cumulative_advantage_(options.cumulative_advantage),
      now_(options.now),
      store_(std::move(store)),
      rows_(store_.get(), static_cast<float>(options.minus_margin)),
      admission_(limiter, store_.get(), &rows_.partitions()),
      drawer_(options.seed_buffer_share, options.seed, store_.get(), &rows_.partitions()),
      statistics_(options.now(), store_.get(), &rows_.partitions()) {}

absl::StatusOr<std::uint32_t> PartitionedBuffer::OpenWriter(const WriterIdentity& identity) {
  absl::MutexLock lock(&mutex_);
  RETURN_IF_ERROR(admission_.CheckOpen());
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

absl::Status PartitionedBuffer::Insert(std::uint32_t place, InsertBatch* batch, absl::Time deadline) {
  RETURN_IF_ERROR(CheckBatch(*batch));
  const std::vector<bool> refused = RefusedRows(layout_, batch->columns);
  const absl::Time now = now_();
  auto end = std::lower_bound(batch->ends.begin(), batch->ends.end(), batch->next_row,
                              [](const RowEnd& e, int row) { return e.row < row; });
  while (batch->next_row < batch->columns.count) {
    absl::MutexLock lock(&mutex_);
    RETURN_IF_ERROR(rows_.CheckHasPlace());
    const std::uint64_t inserted_before = store_->inserted();
    for (int rows = 0; rows < kRowsPerLock && SkipRows(place, refused, batch); ++rows) {
      if (rows > 0 && !admission_.CanInsert()) break;
      if (rows == 0) RETURN_IF_ERROR(admission_.AwaitInsert(&mutex_, deadline));
      // While this one waited, another stream of the writer may have brought the same rows.
      if (rows == 0 && !SkipRows(place, refused, batch)) break;
      rows_.Insert(place, *batch);
      while (end != batch->ends.end() && end->row < batch->next_row) ++end;
      if (end != batch->ends.end() && end->row == batch->next_row) store_->CountEpisode(end->end);
      ++batch->next_row;
    }
    statistics_.CountInserted(now, store_->inserted() - inserted_before);
  }
  return absl::OkStatus();
}

absl::Status PartitionedBuffer::CheckSeedBufferMayCome() const {
  RETURN_IF_ERROR(admission_.CheckOpen());
  return rows_.CheckSeedBufferMayCome();
}

absl::Status PartitionedBuffer::InsertSeedBuffer(absl::Span<const float> rows) {
  const std::size_t stride = static_cast<std::size_t>(layout_.stride());
  DBR_CHECK(rows.size() % stride == 0);
  for (std::size_t from = 0; from < rows.size(); from += kSeedBufferRowsPerLock * stride) {
    absl::MutexLock lock(&mutex_);
    RETURN_IF_ERROR(CheckSeedBufferMayCome());
    RETURN_IF_ERROR(rows_.AppendSeedBuffer(rows.subspan(from, kSeedBufferRowsPerLock * stride)));
  }
  return absl::OkStatus();
}

absl::Status PartitionedBuffer::CompleteSeedBuffer(const SeedBufferRecord& record, bool pin) {
  absl::MutexLock lock(&mutex_);
  RETURN_IF_ERROR(CheckSeedBufferMayCome());
  store_->CompleteSeedBuffer(record, pin);
  return absl::OkStatus();
}

absl::Status PartitionedBuffer::Draw(const DrawRequest& request, const DrawBuffers& out, absl::Time deadline,
                                     DrawResult* result) {
  std::uint64_t asked = 0;
  for (const std::uint32_t count : request.counts) asked += count;
  if (asked == 0)
    return absl::InvalidArgumentError("sample: expected at least one transition to draw, found 0");
  RETURN_IF_ERROR(CheckCount("sample: transitions to draw", asked, kMaxDraws));
  absl::MutexLock lock(&mutex_);
  admission_.CountFrom(request.first_transitions);
  result->raised_tolerance = admission_.MakeRoomFor(asked);
  RETURN_IF_ERROR(admission_.AwaitDraw(&mutex_, request, deadline));
  const Partitions& partitions = rows_.partitions();
  std::uint64_t drawn = 0;
  for (int part = 0; part < kDrawnParts; ++part) {
    result->drawn[part] = partitions.size(part) > 0 ? request.counts[part] : 0;
    drawer_.Draw(part, result->drawn[part], request.seed_buffer_share, out[part]);
    drawn += result->drawn[part];
  }
  store_->counters().sampled += drawn;
  if (store_->online_inserted() == 0) store_->counters().sampled_offline += drawn;
  statistics_.CountDrawn(now_(), drawn);
  result->total = partitions.size(kAll);
  result->plus = partitions.size(kPlus);
  result->minus = partitions.size(kMinus);
  result->unjudged = partitions.size(kUnjudgedPart);
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
  statistics_.CountRelabelled(now, result.relabelled);
  return result;
}

void PartitionedBuffer::RelabelRow(std::uint32_t slot, std::uint64_t version, float advantage) {
  const float before = store_->labels(slot).advantage;
  if (cumulative_advantage_ && before > 0) advantage += before;  // not yet judged (NaN): nothing to add
  if (std::isinf(advantage)) advantage = std::numeric_limits<float>::max();
  rows_.Relabel(slot, version, advantage);
}

BufferStats PartitionedBuffer::Stats() const {
  LabelSurvey survey(kLabelsLookedAt);
  for (bool more = true; more;) {
    absl::MutexLock lock(&mutex_);
    more = survey.LookOn(*store_);
  }
  LabelSummary labels = survey.Summarize();
  const absl::Time now = now_();
  absl::MutexLock lock(&mutex_);
  BufferStats stats = statistics_.Gather(now);
  stats.labels = std::move(labels);
  stats.blocked = admission_.Blocked();
  return stats;
}

void PartitionedBuffer::Close() {
  absl::MutexLock lock(&mutex_);
  admission_.Close();
}

// Takes no lock, for it waits for the disk and reads nothing but where the mapping lies.
absl::Status PartitionedBuffer::Sync() ABSL_NO_THREAD_SAFETY_ANALYSIS {
  return store_->Sync();
}

}  // namespace dbr
