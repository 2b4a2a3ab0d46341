// The replay buffer as a gRPC service.
#pragma once

#include <grpcpp/grpcpp.h>

#include "proto/replay.grpc.pb.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/service/latency_histogram.h"

namespace dbr {

// The calls of proto/replay.proto: each decodes, calls the buffer and encodes. Thread-safe. A call that waits
// for the limiter checks every kCancelCheck whether its client is still there; PartitionedBuffer::Close ends
// all waits.
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
  absl::Status Store(grpc::ServerContext* context, std::uint32_t place, const InsertRequest& request);
  absl::Status ReadInserts(grpc::ServerContext* context, std::uint32_t place,
                           grpc::ServerReaderWriter<InsertReply, InsertRequest>* stream);
  InsertReply Acknowledgement(std::uint32_t place) const;

  PartitionedBuffer* const buffer_;
  LatencyHistogram insert_latency_, sample_latency_, relabel_latency_, stats_latency_;
};

}  // namespace dbr
