#include "replay/service/replay_server.h"

#include <unistd.h>

#include <utility>
#include <vector>

#include "core/status_macros.h"
#include "proto/config/config_file.h"
#include "proto/rpc/deadline.h"
#include "replay/service/service.h"

namespace dbr {

ReplayServerOptions OptionsFrom(const Config& config, const TransitionLayout& layout) {
  const ReplayConfig& replay = config.replay();
  ReplayServerOptions options;
  options.store.env = config.env().name();
  options.store.layout = layout;
  options.store.capacity = replay.capacity();
  options.store.byte_budget = replay.byte_budget();
  options.buffer.limiter.samples_per_insert = replay.samples_per_insert();
  options.buffer.limiter.tolerance =
      replay.tolerance() > 0 ? replay.tolerance()
                             : 0.1 * static_cast<double>(replay.capacity()) * replay.samples_per_insert();
  options.buffer.limiter.min_size = replay.min_size();
  options.buffer.cumulative_advantage = config.algorithm().dbr().advantage() == DbrConfig::ARM_CUMULATIVE;
  options.buffer.minus_margin = config.algorithm().dbr().minus_margin();
  options.buffer.seed = config.seed();
  options.buffer.seed_buffer_share = {.first = replay.seed_buffer().share(),
                                      .final = replay.seed_buffer().final_share(),
                                      .decay_rows = replay.seed_buffer().share_decay_transitions()};
  options.seed_buffer = SeedBufferOptionsFrom(config);
  options.server.address = replay.address();
  options.server.allow_insecure = replay.allow_insecure();
  return options;
}

SeedBufferOptions SeedBufferOptionsFrom(const Config& config) {
  const SeedBufferConfig& seed_buffer = config.replay().seed_buffer();
  return {.path = seed_buffer.path(),
          .layout = seed_buffer.layout(),
          .env = config.env().name(),
          .discount = static_cast<float>(config.algorithm().discount()),
          .n_step = static_cast<int>(config.algorithm().n_step()),
          .evict = seed_buffer.evict(),
          .skip_bad_rows = seed_buffer.skip_bad_rows(),
          .min_rows = config.learner().offline_updates() > 0 ? config.replay().min_size() : 0,
          .others_will_come = !TrainsOfflineAlone(config)};
}

ReplayServer::ReplayServer(std::unique_ptr<PartitionedBuffer> buffer)
    : buffer_(std::move(buffer)), service_(std::make_unique<ReplayService>(buffer_.get())) {}

absl::StatusOr<std::unique_ptr<ReplayServer>> ReplayServer::Start(const ReplayServerOptions& options) {
  ASSIGN_OR_RETURN(std::unique_ptr<TransitionStore> store, TransitionStore::Open(options.store));
  auto server = StartWith(options, std::move(store));
  // A start that fails leaves no empty store behind, which the next start would refuse to overwrite. One that
  // was stopped can be resumed.
  if (!server.ok() && !absl::IsCancelled(server.status()) && !options.store.resume &&
      !options.store.path.empty()) {
    unlink(options.store.path.c_str());
  }
  return server;
}

absl::StatusOr<std::unique_ptr<ReplayServer>> ReplayServer::StartWith(
    const ReplayServerOptions& options, std::unique_ptr<TransitionStore> store) {
  const std::uint64_t recovered = store->size(), torn = store->torn();
  ASSIGN_OR_RETURN(std::unique_ptr<PartitionedBuffer> buffer,
                   PartitionedBuffer::Make(std::move(store), options.buffer));
  std::unique_ptr<ReplayServer> server(new ReplayServer(std::move(buffer)));
  server->recovered_ = recovered;
  server->torn_ = torn;
  if (!options.seed_buffer.path.empty()) {
    ASSIGN_OR_RETURN(server->seed_buffer_, ImportSeedBuffer(options.seed_buffer, server->buffer_.get()));
  }
  const std::vector<grpc::Service*> services = {server->service_.get()};
  ASSIGN_OR_RETURN(server->running_, StartServer(options.server, services));
  return server;
}

absl::Status ReplayServer::Stop() {
  if (running_.server == nullptr) return absl::OkStatus();
  buffer_->Close();
  // Streams of inserts that are idle end only by this deadline.
  running_.server->Shutdown(DeadlineAfter(absl::Milliseconds(500)));
  running_.server->Wait();
  running_.server.reset();
  return buffer_->Sync();
}

ReplayServer::~ReplayServer() {
  Stop().IgnoreError();
}

}  // namespace dbr
