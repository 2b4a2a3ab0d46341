// The replay server behind the program dbr-replay: store, buffer, service and gRPC server in one.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "proto/config.pb.h"
#include "proto/rpc/server.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/service/seed_buffer_import.h"
#include "replay/store/seed_buffer_record.h"
#include "replay/store/transition_store.h"

namespace dbr {

class ReplayService;

struct ReplayServerOptions {
  StoreOptions store;
  BufferOptions buffer;
  SeedBufferOptions seed_buffer;
  ServerOptions server;
};

// The options that `config` gives, for transitions of that layout; the caller sets paths and address. A
// tolerance of 0 becomes a tenth of capacity * samples_per_insert.
ReplayServerOptions OptionsFrom(const Config& config, const TransitionLayout& layout);

// The options of the seed buffer that `config` gives.
SeedBufferOptions SeedBufferOptionsFrom(const Config& config);

// A running replay server. Thread-compatible.
class ReplayServer {
 public:
  // Opens the store, loads the seed buffer, and then serves. Blocks meanwhile. Errors of
  // TransitionStore::Open, PartitionedBuffer::Make, ImportSeedBuffer and StartServer. After
  // ImportSeedBuffer's Cancelled the store stays, for a later start with `store.resume`; after another error
  // a new one is removed.
  static absl::StatusOr<std::unique_ptr<ReplayServer>> Start(const ReplayServerOptions& options);
  ~ReplayServer();  // Stop()
  ReplayServer(const ReplayServer&) = delete;
  ReplayServer& operator=(const ReplayServer&) = delete;

  const std::string& address() const { return running_.address; }
  PartitionedBuffer& buffer() { return *buffer_; }
  std::uint64_t recovered() const { return recovered_; }  // rows taken over from a store
  std::uint64_t torn() const { return torn_; }            // rows that were incomplete there, and dropped

  const SeedBufferRecord& seed_buffer() const { return seed_buffer_; }  // zeros where there is none

  // Accepts no more calls, answers those that wait, and writes the store to disk. Blocks up to some seconds.
  absl::Status Stop();

 private:
  static absl::StatusOr<std::unique_ptr<ReplayServer>> StartWith(const ReplayServerOptions& options,
                                                                 std::unique_ptr<TransitionStore> store);
  explicit ReplayServer(std::unique_ptr<PartitionedBuffer> buffer);

  std::unique_ptr<PartitionedBuffer> buffer_;
  const std::unique_ptr<ReplayService> service_;
  RunningServer running_;
  SeedBufferRecord seed_buffer_;
  std::uint64_t recovered_ = 0;
  std::uint64_t torn_ = 0;
};

}  // namespace dbr
