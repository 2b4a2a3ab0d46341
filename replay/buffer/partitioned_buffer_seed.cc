// How PartitionedBuffer takes a seed of offline data, and draws from it.
#include <algorithm>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/status_macros.h"
#include "replay/buffer/partitioned_buffer.h"

namespace dbr {
namespace {

// The seed as a writer: rows know whose they are. Not an id that TransitionWriter draws.
const WriterIdentity& SeedWriter() {
  static const auto* const identity =
      new WriterIdentity{.id = 0x5eed, .name = "seed", .source = Source::kSeed};
  return *identity;
}

}  // namespace

absl::Status PartitionedBuffer::CheckHasPlace() const {
  if (store_->size() < capacity_ || store_->CanEvict()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("insert: the seed of ", store_->seed_rows(),
                                                 " transitions has every place of the buffer. Raise "
                                                 "replay.capacity or set replay.seed.evict."));
}

absl::Status PartitionedBuffer::CheckSeedMayCome() const {
  if (closed_) return absl::UnavailableError("the replay server is stopping");
  if (store_->online_inserted() == 0 && store_->seed().complete == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("seed: expected a buffer without transitions, found one with a seed of ",
                   store_->seed_rows(), " transitions and ", store_->online_inserted(),
                   " others. A seed comes before all else: start a new run for it."));
}

absl::Status PartitionedBuffer::InsertSeed(absl::Span<const float> rows) {
  const std::size_t stride = static_cast<std::size_t>(layout_.stride());
  DBR_CHECK(rows.size() % stride == 0);
  for (std::size_t from = 0; from < rows.size(); from += kSeedRowsPerLock * stride) {
    const absl::Span<const float> chunk = rows.subspan(from, kSeedRowsPerLock * stride);
    absl::MutexLock lock(&mutex_);
    RETURN_IF_ERROR(CheckSeedMayCome());
    if (chunk.size() / stride > capacity_ - store_->size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("seed: expected at most the ", capacity_,
                       " transitions that the buffer can hold, found more. Raise "
                       "replay.capacity."));
    }
    ASSIGN_OR_RETURN(const std::uint32_t place, store_->writers().Open(SeedWriter()));
    WriterRecord& writer = store_->writers().record(place);
    for (std::size_t row = 0; row < chunk.size(); row += stride) {
      const RowLabels labels{.sequence = store_->next_key(), .writer = place, .source = Source::kSeed};
      partitions_.Add(store_->AppendSeed(chunk.data() + row, labels), labels.advantage, labels.source);
    }
    store_->writers().AddHeld(place, static_cast<std::int64_t>(chunk.size() / stride));
    writer.inserted = writer.last_sequence = store_->seed_rows();
    store_->writers().Close(place);
  }
  return absl::OkStatus();
}

absl::Status PartitionedBuffer::CompleteSeed(const SeedRecord& record, bool pin) {
  absl::MutexLock lock(&mutex_);
  RETURN_IF_ERROR(CheckSeedMayCome());
  store_->CompleteSeed(record, pin);
  return absl::OkStatus();
}

// A share is drawn by row numbers: both kinds stand without gaps, the seed before the others.
void PartitionedBuffer::ChooseSlots(int part, std::uint32_t count) {
  drawn_slots_.resize(count);
  const auto seed = static_cast<std::uint32_t>(store_->seed_held());
  const std::uint32_t others = partitions_.size(kAll) - seed;
  if (part != kAll || seed_share_ == 0 || seed == 0 || others == 0) {
    for (auto& slot : drawn_slots_) slot = partitions_[part].Draw(&rng_);
    return;
  }
  // The expected number of seed rows is exact: what is left of a whole number is drawn by chance.
  const auto from_seed = static_cast<std::size_t>(seed_share_ * count + rng_.Uniform());
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t rank = i < from_seed ? rng_.Below(seed) : seed + rng_.Below(others);
    drawn_slots_[i] = store_->SlotOf(store_->KeyAtRank(rank));
  }
}

}  // namespace dbr
