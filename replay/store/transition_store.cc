#include "replay/store/transition_store.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr std::uint64_t kEmpty = 0;
constexpr std::uint64_t kBeingWritten = std::numeric_limits<std::uint64_t>::max();
constexpr std::size_t kSectionAlignment = 64;
// The buffer's four partitions index every row with 8 bytes each.
constexpr std::uint64_t kIndexBytes = 32;

constexpr std::size_t Aligned(std::size_t bytes) {
  return (bytes + kSectionAlignment - 1) / kSectionAlignment * kSectionAlignment;
}

std::uint64_t MachineMemory() {
  return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

// Rows that `options` allow, or why they make no sense. A row needs `row_bytes`, indices included.
absl::StatusOr<std::uint64_t> RowsFor(const StoreOptions& options, std::uint64_t row_bytes) {
  std::uint64_t rows = options.capacity;
  if (options.byte_budget != 0) rows = std::min(rows, options.byte_budget / row_bytes);
  if (rows == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "replay.byte_budget and replay.capacity: expected room for at least one transition of ", row_bytes,
        " bytes, found ", options.byte_budget, " bytes and ", options.capacity, " transitions"));
  }
  const std::uint64_t memory = options.memory_bytes != 0 ? options.memory_bytes : MachineMemory();
  if (rows > memory / row_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        "replay.capacity: ", rows, " transitions of ", row_bytes, " bytes need ",
        static_cast<double>(rows) * static_cast<double>(row_bytes), " bytes; this machine has ", memory,
        ". Lower replay.capacity to at most ", memory / row_bytes, " or set replay.byte_budget."));
  }
  constexpr std::uint64_t kMaxRows = std::numeric_limits<std::uint32_t>::max() - 1;
  if (rows > kMaxRows) {
    return absl::InvalidArgumentError(
        absl::StrCat("replay.capacity: expected at most ", kMaxRows, ", found ", rows));
  }
  return rows;
}

}  // namespace

std::size_t TransitionStore::ContentBytes(std::uint64_t capacity, int stride) {
  return Aligned(sizeof(StoreCounters)) + Aligned(sizeof(SeedBufferRecord)) +
         Aligned(kRecentEpisodes * sizeof(EpisodeEnd)) +
         Aligned(WriterTable::kPlaces * sizeof(WriterRecord)) + Aligned(capacity * sizeof(Meta)) +
         Aligned(capacity * static_cast<std::size_t>(stride) * sizeof(float));
}

absl::StatusOr<std::unique_ptr<TransitionStore>> TransitionStore::Open(const StoreOptions& options) {
  const int stride = options.layout.stride();
  const std::uint64_t row_bytes =
      static_cast<std::uint64_t>(stride) * sizeof(float) + sizeof(Meta) + kIndexBytes;
  ASSIGN_OR_RETURN(const std::uint64_t capacity, RowsFor(options, row_bytes));
  const StoreShape shape{options.env, options.layout, capacity,
                         StoreFile::kHeaderBytes + ContentBytes(capacity, stride)};
  ASSIGN_OR_RETURN(auto file, StoreFile::Open(options.path, shape, options.resume));
  std::unique_ptr<TransitionStore> store(new TransitionStore(options.layout, capacity, std::move(file)));
  if (options.resume && !options.path.empty()) RETURN_IF_ERROR(store->Recover());
  return store;
}

TransitionStore::TransitionStore(const TransitionLayout& layout, std::uint64_t capacity,
                                 std::unique_ptr<StoreFile> file)
    : layout_(layout),
      stride_(layout.stride()),
      capacity_(capacity),
      bytes_(ContentBytes(capacity, layout.stride()) + capacity * kIndexBytes),
      file_(std::move(file)),
      ring_(capacity) {
  std::byte* section = file_->contents();
  const auto take = [&section](std::size_t bytes) {
    return std::exchange(section, section + Aligned(bytes));
  };
  static_assert(Aligned(sizeof(SeedBufferRecord)) == 128, "the format on disk");
  counters_ = reinterpret_cast<StoreCounters*>(take(sizeof(StoreCounters)));
  seed_buffer_ = reinterpret_cast<SeedBufferRecord*>(take(sizeof(SeedBufferRecord)));
  episodes_ = reinterpret_cast<EpisodeEnd*>(take(kRecentEpisodes * sizeof(EpisodeEnd)));
  writers_ = std::make_unique<WriterTable>(
      reinterpret_cast<WriterRecord*>(take(WriterTable::kPlaces * sizeof(WriterRecord))));
  metas_ = reinterpret_cast<Meta*>(take(capacity * sizeof(Meta)));
  rows_ = reinterpret_cast<float*>(section);
}

// This guards against a file that was damaged, not against our own writing.
bool TransitionStore::LooksWhole(std::uint64_t key) const {
  const Meta& meta = metas_[SlotOf(key)];
  return meta.key == key && meta.labels.writer < WriterTable::kPlaces &&
         writers_->record(meta.labels.writer).id != 0 && !std::isinf(meta.labels.advantage);
}

void TransitionStore::Pin(std::uint64_t rows) {
  pinned_ = rows;
  ring_ = std::max<std::uint64_t>(1, capacity_ - rows);
}

absl::Status TransitionStore::Recover() {
  if (seed_buffer_->complete != 0) {
    if (seed_buffer_->complete != 1 || seed_buffer_->pinned > capacity_ ||
        seed_buffer_->pinned > seed_buffer_->rows) {
      return absl::DataLossError(absl::StrCat("replay store: its record of the seed buffer is damaged (rows ",
                                              seed_buffer_->rows, ", pinned ", seed_buffer_->pinned,
                                              ", capacity ", capacity_, "). Start a new run."));
    }
    Pin(seed_buffer_->pinned);
  }
  std::uint64_t newest = pinned_;
  std::uint64_t keys = 0;
  for (std::uint32_t slot = 0; slot < capacity_; ++slot) {
    const std::uint64_t key = metas_[slot].key;
    if (key == kEmpty) continue;
    ++keys;
    if (key != kBeingWritten && SlotOf(key) == slot && LooksWhole(key)) newest = std::max(newest, key);
  }
  for (std::uint64_t key = 1; key <= pinned_; ++key) {
    if (!LooksWhole(key))
      return absl::DataLossError(
          absl::StrCat("replay store: row ", key, " of its seed buffer is damaged. Start a new run."));
  }
  next_key_ = newest + 1;
  while (ring_size_ < std::min(capacity_ - pinned_, newest - pinned_) && LooksWhole(newest - ring_size_))
    ++ring_size_;
  torn_ = keys - size();
  if (seed_buffer_->complete != 0) {
    seed_buffer_rows_ = std::min(seed_buffer_->rows, inserted());
  } else if (size() > 0 && metas_[SlotOf(oldest_key())].labels.source == Source::kSeedBuffer) {
    seed_buffer_rows_ = inserted();  // the process was killed before it had all
  }
  for (std::uint64_t rank = 0; rank < size(); ++rank) {
    const RowLabels& labels = metas_[SlotOf(KeyAtRank(rank))].labels;
    writers_->AddHeld(labels.writer, 1);
    WriterRecord& writer = writers_->record(labels.writer);
    writer.last_sequence = std::max(writer.last_sequence, labels.sequence);
  }
  return absl::OkStatus();
}

template <class Fill>
std::uint32_t TransitionStore::Write(const RowLabels& labels, const Fill& fill) {
  DBR_CHECK(size() < capacity_);
  const std::uint32_t slot = SlotOf(next_key_);
  Meta& meta = metas_[slot];
  std::atomic_ref<std::uint64_t> commit(meta.key);
  commit.exchange(kBeingWritten, std::memory_order_acq_rel);
  fill(rows_ + std::size_t{slot} * stride_);
  meta.labels = labels;
  commit.store(next_key_, std::memory_order_release);
  ++next_key_;
  ++ring_size_;
  return slot;
}

std::uint32_t TransitionStore::Append(const TransitionView& transition, const RowLabels& labels) {
  return Write(labels, [&transition, this](float* out) { WriteRow(transition, layout_, out); });
}

std::uint32_t TransitionStore::AppendSeedBuffer(const float* row, const RowLabels& labels) {
  DBR_CHECK(seed_buffer_->complete == 0 && online_inserted() == 0);
  ++seed_buffer_rows_;
  return Write(labels, [row, this](float* out) { std::memcpy(out, row, stride_ * sizeof(float)); });
}

void TransitionStore::CompleteSeedBuffer(SeedBufferRecord record, bool pin) {
  DBR_CHECK(seed_buffer_->complete == 0 && online_inserted() == 0);
  record.complete = 0;
  record.rows = seed_buffer_rows_;
  record.pinned = pin ? seed_buffer_rows_ : 0;
  *seed_buffer_ = record;
  std::atomic_ref<std::uint64_t>(seed_buffer_->complete).store(1, std::memory_order_release);
  Pin(record.pinned);
  ring_size_ -= record.pinned;
}

void TransitionStore::Evict() {
  DBR_CHECK(CanEvict());
  --ring_size_;
}

void TransitionStore::SetAdvantage(std::uint32_t slot, float advantage, std::uint64_t critic_version) {
  metas_[slot].labels.critic_version = critic_version;
  metas_[slot].labels.advantage = advantage;
}

void TransitionStore::CountEpisode(const EpisodeEnd& end) {
  episodes_[counters_->episodes % kRecentEpisodes] = end;
  ++counters_->episodes;
}

}  // namespace dbr
