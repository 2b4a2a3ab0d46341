// The only place where messages of the wire and domain types meet.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/batch.h"
#include "core/policy_snapshot.h"
#include "core/transition.h"
#include "proto/policy.pb.h"
#include "proto/transition.pb.h"

namespace dbr {

// Checks that every column has count * width entries and every width is the layout's.
// InvalidArgument names the column, what was expected and what was found.
absl::Status CheckShape(const TransitionBatch& batch, const TransitionLayout& layout);
void SetLayout(const TransitionLayout& layout, TransitionBatch* batch);

// Appends one transition; `batch` has its layout set. The advantage may be kUnjudged.
void AppendTransition(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                      TransitionBatch* batch);

// Copies the columns into `out`, resizing it. InvalidArgument as CheckShape's.
absl::Status Decode(const TransitionBatch& batch, const TransitionLayout& layout, Batch* out);

PolicyMessage Encode(const PolicySnapshot& snapshot);
// DataLoss where the checksum differs; InvalidArgument where a field makes no sense.
absl::StatusOr<PolicySnapshot> Decode(const PolicyMessage& message);

}  // namespace dbr
