#include "replay/service/service.h"

#include <algorithm>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"
#include "core/status_macros.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/protocol.h"
#include "replay/service/service_codec.h"
#include "spdlog/spdlog.h"

namespace dbr {
namespace {

// Calls `wait(deadline)` again and again with deadlines at most kCancelCheck away, until it gives something
// other than DeadlineExceeded, `deadline` has passed, or the client has gone: the synchronous API tells that
// only when asked.
template <class Wait>
absl::Status WaitInSlices(const grpc::ServerContext& context, absl::Time deadline, const Wait& wait) {
  for (;;) {
    const absl::Time slice = std::min(deadline, MonotonicNow() + ReplayService::kCancelCheck);
    const absl::Status status = wait(slice);
    if (status.code() != absl::StatusCode::kDeadlineExceeded || slice == deadline) return status;
    if (context.IsCancelled()) return absl::CancelledError("the client has gone");
  }
}

// The time at which a draw must stop waiting, so that its answer comes before the caller's own deadline.
absl::Time WaitDeadline(const grpc::ServerContext& context, const SampleRequest& request) {
  const absl::Time now = MonotonicNow();
  const absl::Time call_deadline = DeadlineOf(context);
  const absl::Duration margin = std::min(absl::Milliseconds(100), (call_deadline - now) / 10);
  if (!request.has_wait_s()) return call_deadline - margin;
  const double wait_s = request.wait_s() > 0 ? request.wait_s() : 0;  // not a number: 0
  return std::min(call_deadline - margin, now + absl::Seconds(wait_s));
}

// An opening message of another version may say other things in its fields, so that this is asked first.
absl::Status CheckVersion(const InsertRequest& opening) {
  return CheckProtocolVersion(opening.protocol_version(), absl::StrCat("the writer ", opening.writer_name()),
                              "the replay server");
}

void AddLatency(const char* call, const LatencyHistogram& histogram, StatsReply* reply) {
  LatencyStats* stats = reply->add_latencies();
  stats->set_call(call);
  stats->set_count(histogram.count());
  stats->set_p50_us(histogram.QuantileMicroseconds(0.5));
  stats->set_p99_us(histogram.QuantileMicroseconds(0.99));
}

}  // namespace

InsertReply ReplayService::Acknowledgement(std::uint32_t place) const {
  const WriterProgress progress = buffer_->Progress(place);
  InsertReply reply;
  reply.set_acknowledged_sequence(progress.last_sequence);
  reply.set_refused(progress.refused);
  return reply;
}

absl::Status ReplayService::Store(grpc::ServerContext* context, std::uint32_t place,
                                  const InsertRequest& request) {
  if (!request.has_transitions()) return absl::OkStatus();
  const LatencyTimer timer(&insert_latency_);
  std::vector<RowEnd> ends;
  ASSIGN_OR_RETURN(InsertBatch batch, DecodeInsert(request, buffer_->layout(), &ends));
  return WaitInSlices(*context, DeadlineOf(*context),
                      [&](absl::Time deadline) { return buffer_->Insert(place, &batch, deadline); });
}

absl::Status ReplayService::ReadInserts(grpc::ServerContext* context, std::uint32_t place,
                                        grpc::ServerReaderWriter<InsertReply, InsertRequest>* stream) {
  InsertReply answer = Acknowledgement(place);
  answer.set_protocol_version(kProtocolVersion);
  if (!stream->Write(answer)) return absl::OkStatus();
  InsertRequest request;
  while (stream->Read(&request)) {
    RETURN_IF_ERROR(Store(context, place, request));
    if (request.acknowledge() && !stream->Write(Acknowledgement(place))) break;
  }
  return absl::OkStatus();
}

grpc::Status ReplayService::Insert(grpc::ServerContext* context,
                                   grpc::ServerReaderWriter<InsertReply, InsertRequest>* stream) {
  InsertRequest opening;
  if (!stream->Read(&opening)) return grpc::Status::OK;
  if (const absl::Status version = CheckVersion(opening); !version.ok()) return ToGrpc(version);
  const auto identity = DecodeOpening(opening);
  if (!identity.ok()) return ToGrpc(identity.status());
  const auto place = buffer_->OpenWriter(*identity);
  if (!place.ok()) return ToGrpc(place.status());
  const absl::Cleanup close = [&] { buffer_->CloseWriter(*place); };
  return ToGrpc(ReadInserts(context, *place, stream));
}

grpc::Status ReplayService::Sample(grpc::ServerContext* context, const SampleRequest* request,
                                   SampleReply* reply) {
  const LatencyTimer timer(&sample_latency_);
  const TransitionLayout& layout = buffer_->layout();
  const auto draw = DecodeSample(*request, layout);
  if (!draw.ok()) return ToGrpc(draw.status());
  const DrawBuffers room = MakeRoom(*draw, layout, reply);
  DrawResult result;
  const absl::Status status =
      WaitInSlices(*context, WaitDeadline(*context, *request), [&](absl::Time deadline) {
        const absl::Status drawn = buffer_->Draw(*draw, room, deadline, &result);
        if (result.raised_tolerance != 0) {
          spdlog::warn(
              "rate limiter: tolerance raised to {}, half of a draw; a smaller one could block inserts and "
              "draws at once",
              result.raised_tolerance);
        }
        return drawn;
      });
  if (status.ok()) Encode(result, layout, reply);
  return ToGrpc(status);
}

grpc::Status ReplayService::Relabel(grpc::ServerContext*, const RelabelRequest* request,
                                    RelabelReply* reply) {
  const LatencyTimer timer(&relabel_latency_);
  const auto result = buffer_->Relabel(request->critic_version(), request->keys(), request->advantages());
  if (result.ok()) Encode(*result, reply);
  return ToGrpc(result.status());
}

grpc::Status ReplayService::Stats(grpc::ServerContext*, const StatsRequest*, StatsReply* reply) {
  const LatencyTimer timer(&stats_latency_);
  Encode(buffer_->Stats(), reply);
  reply->set_protocol_version(kProtocolVersion);
  AddLatency("insert", insert_latency_, reply);
  AddLatency("sample", sample_latency_, reply);
  AddLatency("relabel", relabel_latency_, reply);
  AddLatency("stats", stats_latency_, reply);
  return grpc::Status::OK;
}

}  // namespace dbr
