#include "replay/buffer/partitioned_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

// The seed buffer as a writer: rows know whose they are. Not an id that TransitionWriter draws.
const WriterIdentity& SeedBufferWriter() {
  static const auto* const identity =
      new WriterIdentity{.id = 0x5eed, .name = "seed_buffer", .source = Source::kSeedBuffer};
  return *identity;
}

}  // namespace

PartitionedRows::PartitionedRows(TransitionStore* store, float minus_margin)
    : store_(*store), partitions_(static_cast<std::uint32_t>(store->capacity()), minus_margin) {
  for (std::uint64_t rank = 0; rank < store_.size(); ++rank) {
    const std::uint32_t slot = store_.SlotOf(store_.KeyAtRank(rank));
    partitions_.Add(slot, store_.labels(slot).advantage, store_.labels(slot).source);
  }
}

absl::Status PartitionedRows::CheckHasPlace() const {
  if (store_.size() < store_.capacity() || store_.CanEvict()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("insert: the seed buffer of ", store_.seed_buffer_rows(),
                                                 " transitions has every place of the buffer. Raise "
                                                 "replay.capacity or set replay.seed_buffer.evict."));
}

void PartitionedRows::Evict() {
  const std::uint32_t slot = store_.SlotOf(store_.oldest_key());
  const RowLabels& labels = store_.labels(slot);
  partitions_.Remove(slot, labels.advantage);
  store_.writers().AddHeld(labels.writer, -1);
  store_.Evict();
}

void PartitionedRows::Insert(std::uint32_t place, const InsertBatch& batch) {
  if (store_.size() == store_.capacity()) Evict();
  const int row = batch.next_row;
  WriterRecord& writer = store_.writers().record(place);
  const RowLabels labels{.sequence = batch.first_sequence + static_cast<std::uint64_t>(row),
                         .critic_version = batch.columns.CriticVersion(row),
                         .advantage = batch.columns.Advantage(row),
                         .writer = place,
                         .source = writer.source};
  const std::uint32_t slot = store_.Append(batch.columns.Row(store_.layout(), row), labels);
  partitions_.Add(slot, labels.advantage, labels.source);
  store_.writers().AddHeld(place, 1);
  writer.last_sequence = labels.sequence;
  ++writer.inserted;
  if (!std::isnan(labels.advantage)) {
    store_.counters().newest_label = std::max(store_.counters().newest_label, labels.critic_version);
  }
}

absl::Status PartitionedRows::CheckSeedBufferMayCome() const {
  if (store_.online_inserted() == 0 && store_.seed_buffer().complete == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("seed buffer: expected a buffer without transitions, found one with a seed buffer of ",
                   store_.seed_buffer_rows(), " transitions and ", store_.online_inserted(),
                   " others. A seed buffer comes before all else: start a new run for it."));
}

absl::Status PartitionedRows::AppendSeedBuffer(absl::Span<const float> rows) {
  const std::size_t stride = static_cast<std::size_t>(store_.layout().stride());
  if (rows.size() / stride > store_.capacity() - store_.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("seed buffer: expected at most the ", store_.capacity(),
                     " transitions that the buffer can hold, found more. Raise replay.capacity."));
  }
  ASSIGN_OR_RETURN(const std::uint32_t place, store_.writers().Open(SeedBufferWriter()));
  WriterRecord& writer = store_.writers().record(place);
  for (std::size_t row = 0; row < rows.size(); row += stride) {
    const RowLabels labels{.sequence = store_.next_key(), .writer = place, .source = Source::kSeedBuffer};
    partitions_.Add(store_.AppendSeedBuffer(rows.data() + row, labels), labels.advantage, labels.source);
  }
  store_.writers().AddHeld(place, static_cast<std::int64_t>(rows.size() / stride));
  writer.inserted = writer.last_sequence = store_.seed_buffer_rows();
  store_.writers().Close(place);
  return absl::OkStatus();
}

void PartitionedRows::Relabel(std::uint32_t slot, std::uint64_t version, float advantage) {
  const RowLabels before = store_.labels(slot);
  store_.SetAdvantage(slot, advantage, version);
  partitions_.Relabel(slot, before.advantage, advantage, before.source);
}

}  // namespace dbr
