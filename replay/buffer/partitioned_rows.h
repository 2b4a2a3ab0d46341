// The rows of the replay buffer with the partitions that they lie in.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "replay/buffer/buffer_types.h"
#include "replay/buffer/partitions.h"
#include "replay/store/transition_store.h"

namespace dbr {

// Changes the rows of a store and keeps its partitions, the counts of its writers and the newest label in
// step with them. Thread-compatible: the buffer's mutex guards it, with the store.
class PartitionedRows {
 public:
  // Takes the rows that the store has. `store` is not owned and outlives this. `minus_margin`: how far below
  // 0 an advantage in D- is. O(size).
  PartitionedRows(TransitionStore* store, float minus_margin);
  PartitionedRows(const PartitionedRows&) = delete;
  PartitionedRows& operator=(const PartitionedRows&) = delete;

  const Partitions& partitions() const { return partitions_; }

  // InvalidArgument where a pinned seed buffer has every place, so that no row can come in.
  absl::Status CheckHasPlace() const;
  // Stores row `batch.next_row` as the next of the writer at `place`; evicts the oldest row where the store
  // is full. Requires that CheckHasPlace is ok. O(stride).
  void Insert(std::uint32_t place, const InsertBatch& batch);

  // FailedPrecondition where the store has a complete seed buffer, or rows of others.
  absl::Status CheckSeedBufferMayCome() const;
  // Stores rows [n x stride] of the seed buffer, not yet judged. Requires that CheckSeedBufferMayCome is ok.
  // InvalidArgument, without storing any, where they are more than fit; errors of WriterTable::Open.
  // O(floats).
  absl::Status AppendSeedBuffer(absl::Span<const float> rows);

  // Sets the advantage of a row, given by a critic of `version`. O(1).
  void Relabel(std::uint32_t slot, std::uint64_t version, float advantage);

 private:
  void Evict();

  TransitionStore& store_;
  Partitions partitions_;
};

}  // namespace dbr
