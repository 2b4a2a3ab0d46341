// Translates between the messages of the replay service and the types of the buffer.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "proto/replay.pb.h"
#include "replay/buffer/buffer_stats.h"
#include "replay/buffer/buffer_types.h"
#include "replay/store/writer_table.h"

namespace dbr {

// Reads the opening message of a stream. InvalidArgument where it carries transitions.
absl::StatusOr<WriterIdentity> DecodeOpening(const InsertRequest& request);

// Gives views into `request` and into `ends`, which it fills; both outlive the result. InvalidArgument where
// the batch has another layout, or an end names a row that is not there.
absl::StatusOr<InsertBatch> DecodeInsert(const InsertRequest& request, const TransitionLayout& layout,
                                         std::vector<RowEnd>* ends);

// Reads the counts. InvalidArgument where the reply would be larger than a message may be.
absl::StatusOr<DrawRequest> DecodeSample(const SampleRequest& request, const TransitionLayout& layout);

// Gives each part of `reply` room for the asked counts, contents unspecified, and returns pointers into it.
DrawBuffers MakeRoom(const DrawRequest& request, const TransitionLayout& layout, SampleReply* reply);
// Completes a reply whose columns are drawn; parts of empty partitions are cleared.
void Encode(const DrawResult& result, const TransitionLayout& layout, SampleReply* reply);

void Encode(const RelabelResult& result, RelabelReply* reply);
void Encode(const BufferStats& stats, StatsReply* reply);

}  // namespace dbr
