// The only place where messages of the wire and domain types meet. Free functions without state; those that
// take a message to be changed want it from one thread at a time.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/batch.h"
#include "core/columns.h"
#include "core/policy_snapshot.h"
#include "core/transition.h"
#include "proto/policy.pb.h"
#include "proto/transition.pb.h"

namespace dbr {

// The columns of `batch`, by the list of core/columns.h. They point into it.
inline ColumnSet<const google::protobuf::RepeatedField<float>*> ColumnsIn(const TransitionBatch& batch) {
#define DBR_POINTER(value, column, width, Kind) .column = &batch.column(),
  return {DBR_TRANSITION_COLUMNS(DBR_POINTER)};
#undef DBR_POINTER
}
inline ColumnSet<google::protobuf::RepeatedField<float>*> ColumnsIn(TransitionBatch* batch) {
#define DBR_POINTER(value, column, width, Kind) .column = batch->mutable_##column(),
  return {DBR_TRANSITION_COLUMNS(DBR_POINTER)};
#undef DBR_POINTER
}

// Checks that every column has count * width entries and every width is the layout's.
// InvalidArgument names the column, what was expected and what was found.
absl::Status CheckShape(const TransitionBatch& batch, const TransitionLayout& layout);
// Writes the widths of `layout` into `batch`, whose columns are filled by them.
void SetLayout(const TransitionLayout& layout, TransitionBatch* batch);

// Appends one transition; `batch` has its layout set, and the transition's spans are as wide. The advantage
// may be kUnjudged; `critic_version` is the version of the critic that gave it.
void AppendTransition(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                      TransitionBatch* batch);

// Copies the columns into `out`, which it resizes, without keys. InvalidArgument as CheckShape's.
absl::Status Decode(const TransitionBatch& batch, const TransitionLayout& layout, Batch* out);

// A policy as the learner publishes it, with a checksum over its parameters.
PolicyMessage Encode(const PolicySnapshot& snapshot);
// DataLoss where the checksum differs; InvalidArgument where a field makes no sense.
absl::StatusOr<PolicySnapshot> Decode(const PolicyMessage& message);

}  // namespace dbr
