#include "replay/service/seed_buffer_import.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"
#include "core/status_macros.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/n_step_rows.h"
#include "replay/dataset/next_action_reader.h"
#include "replay/dataset/return_reader.h"

namespace dbr {
namespace {

absl::Status CheckEnough(const SeedBufferOptions& options, std::uint64_t transitions) {
  if (transitions > 0 && transitions >= options.min_rows) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "replay.seed_buffer.path: expected at least ", std::max<std::uint64_t>(1, options.min_rows),
      " transitions (replay.min_size, before which nothing is drawn), found ", transitions, " in ",
      options.path, ". Lower replay.min_size or take a larger seed buffer."));
}

absl::Status CheckRoom(const SeedBufferOptions& options, std::uint64_t transitions, std::uint64_t capacity) {
  if (transitions > capacity) {
    return absl::InvalidArgumentError(
        absl::StrCat("replay.seed_buffer.path: the seed buffer ", options.path, " has ", transitions,
                     " transitions, the buffer has room for ", capacity,
                     ". Raise replay.capacity to more than ", transitions, "."));
  }
  if (transitions == capacity && options.others_will_come && !options.evict) {
    return absl::InvalidArgumentError(absl::StrCat(
        "replay.seed_buffer.path: the seed buffer ", options.path, " fills all ", capacity,
        " places of the buffer and is never evicted, so that there is none for what the actors do. Raise "
        "replay.capacity, or set replay.seed_buffer.evict: true."));
  }
  return CheckEnough(options, transitions);
}

// Opens a reader of the file and checks that its transitions fit.
absl::StatusOr<std::unique_ptr<DatasetReader>> OpenFitting(const SeedBufferOptions& options,
                                                           const TransitionLayout& layout,
                                                           std::uint64_t capacity) {
  if (layout.mask_width > 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("replay.seed_buffer.path: expected an environment with continuous actions, "
                     "for offline data has none other, found ",
                     options.env));
  }
  if (layout.return_width > 0 && options.discount >= 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        "algorithm.discount: expected below 1 where the returns of a seed buffer are needed (dbr's "
        "advantage SIL, cal_ql), for those of episodes that were cut have no bound else, found ",
        options.discount));
  }
  DatasetOptions dataset{.env = options.env,
                         .observation_size = layout.observation_width,
                         .action_width = layout.action_width,
                         .discount = options.discount,
                         .skip_bad_rows = options.skip_bad_rows,
                         .cancelled = options.cancelled};
  if (!options.layout.empty()) {
    ASSIGN_OR_RETURN(dataset.layout, ParseDatasetLayout(options.layout));
  }
  ASSIGN_OR_RETURN(std::unique_ptr<DatasetReader> reader, DatasetReader::Open(options.path, dataset));
  ASSIGN_OR_RETURN(const std::int64_t transitions, reader->CountTransitions());
  RETURN_IF_ERROR(CheckRoom(options, static_cast<std::uint64_t>(transitions), capacity));
  return reader;
}

SeedBufferRecord RecordOf(const DatasetFacts& facts, absl::Duration elapsed) {
  return {.bad_rows = static_cast<std::uint64_t>(facts.bad_rows),
          .episodes = static_cast<std::uint64_t>(facts.episodes),
          .return_mean = facts.return_mean,
          .return_std = facts.return_std,
          .return_min = facts.return_min,
          .return_max = facts.return_max,
          .rows_per_second = static_cast<double>(facts.transitions) / absl::ToDoubleSeconds(elapsed),
          .actions_outside = static_cast<std::uint64_t>(facts.actions_outside)};
}

// The file's rows [n x stride], as the buffer lays them: with returns or next actions where it wants them,
// and of up to options.n_step steps.
class SeedBufferRows {
 public:
  // `reader` outlives this.
  SeedBufferRows(DatasetReader* reader, const TransitionLayout& layout, const SeedBufferOptions& options)
      : reader_(reader), stride_(static_cast<std::size_t>(layout.stride())) {
    if (options.n_step > 1) n_step_.emplace(layout, options.n_step);
    if (layout.return_width > 0) {
      returns_.emplace(reader, options.discount);
    } else if (layout.next_action_width > 0) {
      next_actions_.emplace(reader);
    } else {
      chunk_.emplace(layout, PartitionedBuffer::kSeedBufferRowsPerLock);
    }
  }

  // The next rows; none at the end. They are valid until the next call.
  absl::StatusOr<absl::Span<const float>> Next() {
    if (!n_step_.has_value()) return NextSteps();
    n_step_->Clear();
    while (n_step_->rows().empty()) {
      ASSIGN_OR_RETURN(const absl::Span<const float> steps, NextSteps());
      for (std::size_t i = 0; i * stride_ < steps.size(); ++i) n_step_->Add(&steps[i * stride_], Starts(i));
      if (!steps.empty()) continue;
      n_step_->Finish();
      break;
    }
    return n_step_->rows();
  }

 private:
  // The next rows of one step each.
  absl::StatusOr<absl::Span<const float>> NextSteps() {
    if (returns_.has_value()) return returns_->Next();
    if (next_actions_.has_value()) return next_actions_->Next();
    RETURN_IF_ERROR(reader_->Next(&*chunk_).status());
    return chunk_->rows();
  }

  // Whether row i of the newest NextSteps() does not follow the row before it.
  bool Starts(std::size_t i) const {
    if (returns_.has_value()) return i == 0;
    return next_actions_.has_value() ? next_actions_->Starts(i) : chunk_->starts[i] != 0;
  }

  DatasetReader* const reader_;
  const std::size_t stride_;  // floats
  std::optional<ReturnReader> returns_;
  std::optional<NextActionReader> next_actions_;
  std::optional<TransitionChunk> chunk_;  // without either
  std::optional<NStepRows> n_step_;       // where n_step > 1
};

}  // namespace

absl::Status CheckSeedBufferFits(const SeedBufferOptions& options, const TransitionLayout& layout,
                                 std::uint64_t capacity) {
  return OpenFitting(options, layout, capacity).status();
}

absl::StatusOr<SeedBufferRecord> ImportSeedBuffer(const SeedBufferOptions& options,
                                                  PartitionedBuffer* buffer) {
  const BufferStats before = buffer->Stats();
  if (before.seed_buffer_record.complete != 0) return before.seed_buffer_record;
  const absl::Time start = MonotonicNow();
  const TransitionLayout& layout = buffer->layout();
  ASSIGN_OR_RETURN(const std::unique_ptr<DatasetReader> reader,
                   OpenFitting(options, layout, buffer->capacity()));
  SeedBufferRows seed_buffer(reader.get(), layout, options);
  std::uint64_t held_already =
      before.seed_buffer_rows * static_cast<std::uint64_t>(layout.stride());  // floats
  for (;;) {
    ASSIGN_OR_RETURN(const absl::Span<const float> rows, seed_buffer.Next());
    if (rows.empty()) break;
    const std::uint64_t skipped = std::min(held_already, static_cast<std::uint64_t>(rows.size()));
    held_already -= skipped;
    RETURN_IF_ERROR(buffer->InsertSeedBuffer(rows.subspan(skipped)));
  }
  // Bad rows may have been left out.
  RETURN_IF_ERROR(CheckEnough(options, static_cast<std::uint64_t>(reader->facts().transitions)));
  if (buffer->Stats().seed_buffer_rows == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "replay.seed_buffer.path: expected transitions that are followed by another one or end in a true ",
        "terminal, for algorithm.rebrac.critic_penalty needs the next action, found none in ", options.path,
        ". Set critic_penalty: 0 or take another file."));
  }
  RETURN_IF_ERROR(
      buffer->CompleteSeedBuffer(RecordOf(reader->facts(), MonotonicNow() - start), !options.evict));
  return buffer->Stats().seed_buffer_record;
}

}  // namespace dbr
