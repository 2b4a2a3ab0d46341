// The replay buffer as a gRPC service.
#pragma once

#include <grpcpp/grpcpp.h>

#include "proto/replay.grpc.pb.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/service/latency_histogram.h"

namespace dbr {

// Decodes, calls the buffer, encodes. Thread-safe. A call that waits for the limiter looks every kCancelCheck
// whether its client is still there; PartitionedBuffer::Close ends all waits. A stream of inserts whose
// opening message is of another protocol version is refused with FAILED_PRECONDITION (proto/rpc/protocol.h).
class ReplayService final : public Replay::Service {
 public:
  static constexpr absl::Duration kCancelCheck = absl::Milliseconds(200);

  // `buffer` is not owned and outlives this.
  explicit ReplayService(PartitionedBuffer* buffer) : buffer_(buffer) {}

  grpc::Status Insert(grpc::ServerContext* context,
                      grpc::ServerReaderWriter<InsertReply, InsertRequest>* stream) override;
  grpc::Status Sample(grpc::ServerContext* context, const SampleRequest* request,
                      SampleReply* reply) override;
  grpc::Status Relabel(grpc::ServerContext* context, const RelabelRequest* request,
                       RelabelReply* reply) override;
  grpc::Status Stats(grpc::ServerContext* context, const StatsRequest* request, StatsReply* reply) override;

 private:
  // Stores the transitions of a message, if it has any; blocks while the limiter holds them.
  absl::Status Store(grpc::ServerContext* context, std::uint32_t place, const InsertRequest& request);
  // Answers the opening message, then stores and acknowledges what comes until the stream ends.
  absl::Status ReadInserts(grpc::ServerContext* context, std::uint32_t place,
                           grpc::ServerReaderWriter<InsertReply, InsertRequest>* stream);
  InsertReply Acknowledgement(std::uint32_t place) const;

  PartitionedBuffer* const buffer_;
  LatencyHistogram insert_latency_, sample_latency_, relabel_latency_, stats_latency_;
};

}  // namespace dbr
