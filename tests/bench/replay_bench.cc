// The speed of the replay: the buffer alone, and through gRPC on a unix socket. Rows have the shape of
// Connect-4's.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/monotonic_clock.h"
#include "core/rng.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/client/client.h"
#include "replay/client/writer.h"
#include "replay/dataset/dataset_writer.h"
#include "replay/service/replay_server.h"
#include "replay/service/seed_buffer_import.h"

namespace dbr {
namespace {

constexpr TransitionLayout kLayout{.observation_width = 84, .action_width = 1, .mask_width = 7};
constexpr std::uint64_t kCapacity = 200000;
constexpr int kRowsInMessage = 44;  // 32 KiB
constexpr int kBatch = 256;
constexpr absl::Duration kTimeout = absl::Seconds(60);

// `count` rows of zeros and ones, with advantages of both signs.
struct Columns : ColumnSet<std::vector<float>> {
  explicit Columns(int count) : advantages(count), versions(count, 1), keys(count) {
    ForEachColumn(
        [count](const ColumnPlace& place, auto& column) {
          column.assign(static_cast<std::size_t>(count) * place.width, 1.0f);
        },
        kLayout.columns(), *this);
    Rng rng(1);
    for (float& value : observations) value = static_cast<float>(rng.Below(2));
    next_observations = observations;
    actions.assign(actions.size(), 0.0f);
    rewards.assign(rewards.size(), 0.0f);
    discounts.assign(discounts.size(), 0.99f);
    for (float& value : advantages) value = static_cast<float>(rng.Normal());
  }
  InsertColumns insert() const {
    InsertColumns views;
    views.count = static_cast<int>(rewards.size());
    ForEachColumn([](const auto& from, const float*& to) { to = from.data(); }, *this, views);
    views.advantages = advantages.data();
    views.critic_versions = versions.data();
    return views;
  }
  DrawColumns draw() {
    DrawColumns room;
    room.keys = keys.data();
    ForEachColumn([](auto& from, float*& to) { to = from.data(); }, *this, room);
    return room;
  }
  std::vector<float> advantages;
  std::vector<std::uint64_t> versions, keys;
};

// A full buffer in memory.
class FullBuffer {
 public:
  FullBuffer() {
    StoreOptions options;
    options.env = "connect4";
    options.layout = kLayout;
    options.capacity = kCapacity;
    auto store = TransitionStore::Open(options);
    DBR_CHECK(store.ok());
    auto made = PartitionedBuffer::Make(std::move(*store), {});
    DBR_CHECK(made.ok());
    buffer = std::move(*made);
    auto opened = buffer->OpenWriter({.id = 1, .name = "bench"});
    DBR_CHECK(opened.ok());
    place = *opened;
    for (std::uint64_t i = 0; i < kCapacity; i += kRowsInMessage) Insert();
  }
  void Insert() {
    InsertBatch batch;
    batch.first_sequence = next_sequence;
    batch.columns = message.insert();
    DBR_CHECK(buffer->Insert(place, &batch, absl::InfiniteFuture()).ok());
    next_sequence += kRowsInMessage;
  }
  std::unique_ptr<PartitionedBuffer> buffer;
  std::uint32_t place = 0;
  std::uint64_t next_sequence = 1;
  Columns message{kRowsInMessage};
};

void BufferInsert(benchmark::State& state) {
  FullBuffer full;
  for (auto _ : state) full.Insert();
  state.SetItemsProcessed(state.iterations() * kRowsInMessage);
}
BENCHMARK(BufferInsert);

void BufferSample(benchmark::State& state) {
  FullBuffer full;
  Columns columns(kBatch);
  const DrawBuffers out = {columns.draw(), {}, {}};
  DrawResult result;
  for (auto _ : state) {
    DBR_CHECK(full.buffer->Draw({.counts = {kBatch, 0, 0}}, out, absl::InfiniteFuture(), &result).ok());
  }
  state.SetItemsProcessed(state.iterations());  // batches
}
BENCHMARK(BufferSample);

void BufferRelabel(benchmark::State& state) {
  FullBuffer full;
  Rng rng(2);
  std::vector<std::uint64_t> keys(kBatch);
  std::vector<float> advantages(kBatch);
  std::uint64_t version = 1;
  for (auto _ : state) {
    for (auto& key : keys) key = full.next_sequence - 1 - rng.Below(kCapacity);
    for (auto& advantage : advantages) advantage = static_cast<float>(rng.Uniform()) - 0.5f;
    DBR_CHECK(full.buffer->Relabel(++version, keys, advantages)->relabelled == kBatch);
  }
  state.SetItemsProcessed(state.iterations() * kBatch);
}
BENCHMARK(BufferRelabel);

// A server on a unix socket with its store in a file, and a client in this process.
class Served {
 public:
  Served() {
    DBR_CHECK(mkdtemp(folder_.data()) != nullptr);
    ReplayServerOptions options;
    options.store = {
        .path = absl::StrCat(folder_, "/store"), .env = "connect4", .layout = kLayout, .capacity = kCapacity};
    options.server.address = absl::StrCat("unix:", folder_, "/replay.sock");
    auto started = ReplayServer::Start(options);
    DBR_CHECK(started.ok());
    server = std::move(*started);
    WriterOptions writer_options;
    writer_options.address = server->address();
    writer_options.name = "bench";
    writer_options.layout = kLayout;
    writer = std::make_unique<TransitionWriter>(writer_options);
  }
  ~Served() {
    writer.reset();
    server.reset();
    std::filesystem::remove_all(folder_);
  }
  // Writes `count` transitions and blocks until all are acknowledged.
  void Write(int count) {
    for (int i = 0; i < count; ++i) {
      const int row = i % kRowsInMessage;
      DBR_CHECK(
          writer
              ->Append(message.insert().Row(kLayout, row), message.advantages[row], 1, std::nullopt, kTimeout)
              .ok());
    }
    DBR_CHECK(writer->Flush(kTimeout).ok());
  }

 private:
  std::string folder_ = (std::filesystem::temp_directory_path() / "dbr-XXXXXX").string();

 public:
  std::unique_ptr<ReplayServer> server;
  std::unique_ptr<TransitionWriter> writer;
  Columns message{kRowsInMessage};
};

// Items are transitions that one thread appends and waits for. The latency is the server's, for one message.
void ReplayInsert(benchmark::State& state) {
  constexpr int kWrites = 30000;
  Served served;
  served.Write(kCapacity);
  for (auto _ : state) served.Write(kWrites);
  state.SetItemsProcessed(state.iterations() * kWrites);
  const auto stats = ReplayClient(served.server->address()).Stats(kTimeout);
  DBR_CHECK(stats.ok());
  for (const LatencyStats& latency : stats->latencies()) {
    if (latency.call() != "insert") continue;
    state.counters["p50_us"] = latency.p50_us();
    state.counters["p99_us"] = latency.p99_us();
  }
}
BENCHMARK(ReplayInsert)->UseRealTime()->Unit(benchmark::kMillisecond);

// Batches of 256 that one caller draws from D and decodes. The latency is the caller's.
void ReplaySample(benchmark::State& state) {
  Served served;
  served.Write(kCapacity);
  ReplayClient client(served.server->address());
  DrawnBatches drawn;
  std::vector<double> latencies_us;
  for (auto _ : state) {
    const absl::Time start = MonotonicNow();
    DBR_CHECK(client.Sample({.uniform = kBatch}, kLayout, kTimeout, &drawn).ok());
    latencies_us.push_back(absl::ToDoubleMicroseconds(MonotonicNow() - start));
  }
  state.SetItemsProcessed(state.iterations());  // batches
  std::sort(latencies_us.begin(), latencies_us.end());
  state.counters["p50_us"] = latencies_us[latencies_us.size() / 2];
  state.counters["p99_us"] = latencies_us[latencies_us.size() * 99 / 100];
}
BENCHMARK(ReplaySample)->UseRealTime()->Unit(benchmark::kMicrosecond);

// A file of robot data as `dbr dataset record` writes it: the hopper's sizes, episodes of 1,000 steps.
class SeedBufferFile {
 public:
  static constexpr int kEpisodes = 200, kSteps = 1000;

  SeedBufferFile() {
    DBR_CHECK(mkdtemp(folder_.data()) != nullptr);
    const EnvSpec env{.name = "hopper",
                      .observation_size = 15,
                      .actions = {ActionKind::kContinuous, 3},
                      .max_episode_steps = kSteps};
    layout = TransitionLayout::Of(env);
    const auto writer = DatasetWriter::Create(path(), {.layout = DatasetLayout::kD4rl, .env = env});
    DBR_CHECK(writer.ok());
    Rng rng(1);
    std::vector<float> observations((kSteps + 1) * env.observation_size), actions(kSteps * env.actions.size),
        rewards(kSteps);
    for (int episode = 0; episode < kEpisodes; ++episode) {
      for (auto* column : {&observations, &actions, &rewards}) {
        for (float& value : *column) value = static_cast<float>(rng.Normal());
      }
      DBR_CHECK((*writer)->Append({observations, actions, rewards, EpisodeEnding::kTimeLimit}).ok());
    }
    DBR_CHECK((*writer)->Finish().ok());
  }
  ~SeedBufferFile() { std::filesystem::remove_all(folder_); }

  std::string path() const { return absl::StrCat(folder_, "/seed.hdf5"); }
  std::string store() const { return absl::StrCat(folder_, "/store"); }
  TransitionLayout layout;

 private:
  std::string folder_ = (std::filesystem::temp_directory_path() / "dbr-XXXXXX").string();
};

// Imports the file into a store in a file, on one thread.
void SeedBufferImport(benchmark::State& state) {
  const SeedBufferFile file;
  for (auto _ : state) {
    state.PauseTiming();
    std::filesystem::remove(file.store());
    auto store = TransitionStore::Open({.path = file.store(),
                                        .env = "hopper",
                                        .layout = file.layout,
                                        .capacity = 2 * SeedBufferFile::kEpisodes * SeedBufferFile::kSteps});
    DBR_CHECK(store.ok());
    auto buffer = PartitionedBuffer::Make(std::move(*store), {});
    DBR_CHECK(buffer.ok());
    state.ResumeTiming();
    DBR_CHECK(ImportSeedBuffer({.path = file.path(), .layout = "d4rl", .env = "hopper"}, buffer->get()).ok());
    state.PauseTiming();
    buffer->reset();
    state.ResumeTiming();
  }
  state.SetItemsProcessed(state.iterations() * SeedBufferFile::kEpisodes * SeedBufferFile::kSteps);
}
BENCHMARK(SeedBufferImport)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dbr
