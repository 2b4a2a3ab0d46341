// How PartitionedBuffer takes a seed buffer of offline data, and draws from it.
#include <algorithm>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/status_macros.h"
#include "replay/buffer/partitioned_buffer.h"

namespace dbr {
namespace {

// The seed buffer as a writer: rows know whose they are. Not an id that TransitionWriter draws.
const WriterIdentity& SeedBufferWriter() {
  static const auto* const identity =
      new WriterIdentity{.id = 0x5eed, .name = "seed_buffer", .source = Source::kSeedBuffer};
  return *identity;
}

}  // namespace

absl::Status PartitionedBuffer::CheckHasPlace() const {
  if (store_->size() < capacity_ || store_->CanEvict()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("insert: the seed buffer of ", store_->seed_buffer_rows(),
                                                 " transitions has every place of the buffer. Raise "
                                                 "replay.capacity or set replay.seed_buffer.evict."));
}

absl::Status PartitionedBuffer::CheckSeedBufferMayCome() const {
  if (closed_) return absl::UnavailableError("the replay server is stopping");
  if (store_->online_inserted() == 0 && store_->seed_buffer().complete == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("seed buffer: expected a buffer without transitions, found one with a seed buffer of ",
                   store_->seed_buffer_rows(), " transitions and ", store_->online_inserted(),
                   " others. A seed buffer comes before all else: start a new run for it."));
}

absl::Status PartitionedBuffer::InsertSeedBuffer(absl::Span<const float> rows) {
  const std::size_t stride = static_cast<std::size_t>(layout_.stride());
  DBR_CHECK(rows.size() % stride == 0);
  for (std::size_t from = 0; from < rows.size(); from += kSeedBufferRowsPerLock * stride) {
    const absl::Span<const float> chunk = rows.subspan(from, kSeedBufferRowsPerLock * stride);
    absl::MutexLock lock(&mutex_);
    RETURN_IF_ERROR(CheckSeedBufferMayCome());
    if (chunk.size() / stride > capacity_ - store_->size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("seed buffer: expected at most the ", capacity_,
                       " transitions that the buffer can hold, found more. Raise "
                       "replay.capacity."));
    }
    ASSIGN_OR_RETURN(const std::uint32_t place, store_->writers().Open(SeedBufferWriter()));
    WriterRecord& writer = store_->writers().record(place);
    for (std::size_t row = 0; row < chunk.size(); row += stride) {
      const RowLabels labels{.sequence = store_->next_key(), .writer = place, .source = Source::kSeedBuffer};
      partitions_.Add(store_->AppendSeedBuffer(chunk.data() + row, labels), labels.advantage, labels.source);
    }
    store_->writers().AddHeld(place, static_cast<std::int64_t>(chunk.size() / stride));
    writer.inserted = writer.last_sequence = store_->seed_buffer_rows();
    store_->writers().Close(place);
  }
  return absl::OkStatus();
}

absl::Status PartitionedBuffer::CompleteSeedBuffer(const SeedBufferRecord& record, bool pin) {
  absl::MutexLock lock(&mutex_);
  RETURN_IF_ERROR(CheckSeedBufferMayCome());
  store_->CompleteSeedBuffer(record, pin);
  return absl::OkStatus();
}

// A share is drawn by row numbers: both kinds stand without gaps, the seed buffer before the others.
void PartitionedBuffer::ChooseSlots(int part, std::uint32_t count) {
  drawn_slots_.resize(count);
  const auto seed_buffer = static_cast<std::uint32_t>(store_->seed_buffer_held());
  const std::uint32_t others = partitions_.size(kAll) - seed_buffer;
  if (part != kAll || seed_buffer_share_ == 0 || seed_buffer == 0 || others == 0) {
    for (auto& slot : drawn_slots_) slot = partitions_[part].Draw(&rng_);
    return;
  }
  // The expected number of seed buffer rows is exact: what is left of a whole number is drawn by chance.
  const auto from_seed_buffer = static_cast<std::size_t>(seed_buffer_share_ * count + rng_.Uniform());
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t rank =
        i < from_seed_buffer ? rng_.Below(seed_buffer) : seed_buffer + rng_.Below(others);
    drawn_slots_[i] = store_->SlotOf(store_->KeyAtRank(rank));
  }
}

}  // namespace dbr
