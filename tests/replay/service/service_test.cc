// The service, the writer and the client over a real unix socket.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <thread>

#include "absl/strings/str_cat.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/server.h"
#include "replay/client/client.h"
#include "replay/client/writer.h"
#include "replay/service/replay_server.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr absl::Duration kPatience =
    absl::Seconds(60);  // for what must happen; only a failure waits that long

class ReplayOverSocket : public ::testing::Test {
 protected:
  ReplayOverSocket() {
    options_.store.env = "connect4";
    options_.store.layout = kSmallLayout;
    options_.store.capacity = 10000;
    options_.store.path = absl::StrCat(folder_.path(), "/replay.store");
    options_.server.address = absl::StrCat("unix:", folder_.path(), "/replay.sock");
  }

  void StartServer() {
    auto server = ReplayServer::Start(options_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = std::move(*server);
  }
  void StopServer() {
    ASSERT_TRUE(server_->Stop().ok());
    server_.reset();
  }

  WriterOptions Writer() {
    WriterOptions options;
    options.address = options_.server.address;
    options.name = "actor-0";
    options.layout = kSmallLayout;
    return options;
  }

  // Appends transitions first, first + 1, ...
  static absl::Status Append(TransitionWriter* writer, std::uint64_t first, int count,
                             float advantage = kUnjudged, absl::Duration timeout = kPatience) {
    const Rows rows(kSmallLayout, first, count);
    for (int i = 0; i < count; ++i) {
      const absl::Status status =
          writer->Append(rows.columns().Row(kSmallLayout, i), advantage, 1, std::nullopt, timeout);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  StatsReply Stats() {
    auto stats = ReplayClient(options_.server.address).Stats(kPatience);
    EXPECT_TRUE(stats.ok()) << stats.status();
    return stats.ok() ? *stats : StatsReply();
  }

  TestFolder folder_;
  ReplayServerOptions options_;
  std::unique_ptr<ReplayServer> server_;
};

TEST_F(ReplayOverSocket, GivesBackWhatWasWritten) {
  StartServer();
  TransitionWriter writer(Writer());
  ASSERT_TRUE(Append(&writer, 1, 600, 1.0f).ok());
  ASSERT_TRUE(Append(&writer, 601, 400, -1.0f).ok());
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  EXPECT_EQ(writer.counters().acknowledged, 1000u);

  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  const absl::Status status =
      client.Sample({.uniform = 64, .plus = 32, .minus = 16}, kSmallLayout, kPatience, &drawn);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(drawn.total_size, 1000u);
  EXPECT_EQ(drawn.plus_size, 600u);
  EXPECT_EQ(drawn.minus_size, 400u);
  EXPECT_EQ(drawn.uniform.size(), 64);
  EXPECT_EQ(drawn.plus.size(), 32);
  EXPECT_EQ(drawn.minus.size(), 16);
  for (int i = 0; i < 32; ++i) EXPECT_LE(drawn.plus.rewards[i], 600);
  for (int i = 0; i < 16; ++i) EXPECT_GT(drawn.minus.rewards[i], 600);
  for (int i = 0; i < 64; ++i) {
    const Rows expected(kSmallLayout, static_cast<std::uint64_t>(drawn.uniform.rewards[i]), 1);
    EXPECT_EQ(drawn.uniform.observations(3, i), expected.observations[3]);
    EXPECT_EQ(drawn.uniform.next_masks(1, i), expected.next_masks[1]);
    EXPECT_EQ(drawn.uniform.keys[i], static_cast<std::uint64_t>(drawn.uniform.rewards[i]));
  }
}

TEST_F(ReplayOverSocket, ReturnsComeBackAndAMissingOneIsRefused) {
  options_.store.layout = kLayoutWithReturns;
  StartServer();
  WriterOptions writing = Writer();
  writing.layout = kLayoutWithReturns;
  TransitionWriter writer(writing);
  const Rows rows(kLayoutWithReturns, 1, 100);
  for (int i = 0; i < 100; ++i) {
    TransitionView row = rows.columns().Row(kLayoutWithReturns, i);
    if (i == 50) row.monte_carlo_return = kNoReturn;
    ASSERT_TRUE(writer.Append(row, i % 2 == 0 ? 1 : -1, 1, std::nullopt, kPatience).ok());
  }
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  EXPECT_EQ(writer.counters().refused, 1u);
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  ASSERT_TRUE(
      client.Sample({.uniform = 60, .plus = 50, .minus = 40}, kLayoutWithReturns, kPatience, &drawn).ok());
  for (const Batch* batch : {&drawn.uniform, &drawn.plus, &drawn.minus}) {
    ASSERT_EQ(batch->returns.size(), batch->size());
    for (int i = 0; i < batch->size(); ++i) {
      const Rows expected(kLayoutWithReturns, static_cast<std::uint64_t>(batch->rewards[i]), 1);
      EXPECT_EQ(batch->returns[i], expected.returns[0]);
      EXPECT_EQ(batch->next_observations(3, i), expected.next_observations[3]);
    }
  }
  EXPECT_THAT(client.Sample({.uniform = 4}, kSmallLayout, kPatience, &drawn).ToString(),
              HasSubstr("return_width: expected 0, found 1"));
}

TEST_F(ReplayOverSocket, CountsEpisodesAndRefusedRows) {
  StartServer();
  TransitionWriter writer(Writer());
  Rows rows(kSmallLayout, 1, 3);
  rows.rewards[1] = std::nanf("");
  ASSERT_TRUE(writer.Append(rows.columns().Row(kSmallLayout, 0), 1, 1, EpisodeEnd{2, 1, 7}, kPatience).ok());
  ASSERT_TRUE(writer.Append(rows.columns().Row(kSmallLayout, 1), 1, 1, std::nullopt, kPatience).ok());
  ASSERT_TRUE(writer.Append(rows.columns().Row(kSmallLayout, 2), 1, 1, EpisodeEnd{4, 0, 9}, kPatience).ok());
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  const WriterCounters counters = writer.counters();
  EXPECT_EQ(counters.appended, 3u);
  EXPECT_EQ(counters.acknowledged, 3u);
  EXPECT_EQ(counters.refused, 1u);
  const StatsReply stats = Stats();
  EXPECT_EQ(stats.episodes(), 2u);
  EXPECT_EQ(stats.recent_return_mean(), 3);
  EXPECT_EQ(stats.recent_score_mean(), 0.5);
  EXPECT_EQ(stats.recent_length_mean(), 8);
  EXPECT_EQ(stats.refused(), 1u);
}

TEST_F(ReplayOverSocket, AWriterMayStartBeforeTheServer) {
  TransitionWriter writer(Writer());
  ASSERT_TRUE(Append(&writer, 1, 100).ok());
  EXPECT_EQ(writer.Flush(absl::Milliseconds(1)).code(), absl::StatusCode::kDeadlineExceeded);
  StartServer();
  EXPECT_TRUE(writer.Flush(kPatience).ok());
  EXPECT_EQ(Stats().total(), 100u);
}

TEST_F(ReplayOverSocket, NothingIsLostOrDoubledWhenTheServerComesAndGoes) {
  options_.store.capacity = 100000;
  StartServer();
  options_.store.resume = true;
  constexpr int kRows = 20000;
  WriterOptions writer_options = Writer();
  writer_options.batch_bytes = 1024;
  writer_options.buffered_transitions = 1000;
  TransitionWriter writer(writer_options);
  std::thread actor([&] { EXPECT_TRUE(Append(&writer, 1, kRows).ok()); });
  for (int stop = 0; stop < 5; ++stop) {
    const std::uint64_t acknowledged = writer.counters().acknowledged;
    while (acknowledged + 500 < kRows && writer.counters().acknowledged < acknowledged + 500)
      std::this_thread::yield();
    StopServer();
    StartServer();
  }
  actor.join();
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  const StatsReply stats = Stats();
  EXPECT_EQ(stats.inserted(), static_cast<std::uint64_t>(kRows));
  ASSERT_EQ(stats.writers_size(), 1);
  EXPECT_EQ(stats.writers(0).id(), writer.id());
  EXPECT_EQ(stats.writers(0).last_sequence(), static_cast<std::uint64_t>(kRows));
  // Every transition is there exactly once: keys and values count up together.
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  ASSERT_TRUE(client.Sample({.uniform = 5000}, kSmallLayout, kPatience, &drawn).ok());
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(Rows::Value(drawn.uniform.keys[i]), drawn.uniform.rewards[i]);
}

TEST_F(ReplayOverSocket, AWriterGoesOnWhereAServerComesBackWithNothing) {
  StartServer();
  TransitionWriter writer(Writer());
  ASSERT_TRUE(Append(&writer, 1, 100).ok());
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  StopServer();
  options_.store.path += ".2";
  StartServer();
  ASSERT_TRUE(Append(&writer, 101, 50).ok());
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  EXPECT_EQ(Stats().total(), 50u);
  EXPECT_EQ(Stats().writers(0).last_sequence(), 150u);
}

TEST_F(ReplayOverSocket, AFullBufferHoldsTheWriterUntilItIsDrawnFrom) {
  options_.buffer.limiter = {.samples_per_insert = 1, .tolerance = 50, .min_size = 10};
  StartServer();
  WriterOptions writer_options = Writer();
  writer_options.buffered_transitions = 100;
  TransitionWriter writer(writer_options);
  ASSERT_TRUE(
      Append(&writer, 1, 100).ok());  // 61 are let in; their message waits for its end to be acknowledged
  const absl::Status status = Append(&writer, 101, 1, 1, absl::Milliseconds(1));
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(status.ToString(), HasSubstr("buffer of this writer is full"));
  EXPECT_EQ(writer.Flush(absl::Milliseconds(1)).code(), absl::StatusCode::kDeadlineExceeded);
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  for (int i = 0; i < 2; ++i) {
    const absl::Status sampled = client.Sample({.uniform = 50}, kSmallLayout, kPatience, &drawn);
    ASSERT_TRUE(sampled.ok()) << sampled;
  }
  EXPECT_TRUE(writer.Flush(kPatience).ok());
  EXPECT_EQ(Stats().total(), 100u);
}

TEST_F(ReplayOverSocket, CloseWakesBlockedWriters) {
  WriterOptions writer_options = Writer();
  writer_options.buffered_transitions = 10;
  TransitionWriter writer(writer_options);  // no server
  ASSERT_TRUE(Append(&writer, 1, 10).ok());
  std::thread actor([&] {
    EXPECT_EQ(Append(&writer, 11, 1, 1, absl::InfiniteDuration()).code(), absl::StatusCode::kCancelled);
  });
  std::thread flusher(
      [&] { EXPECT_EQ(writer.Flush(absl::InfiniteDuration()).code(), absl::StatusCode::kCancelled); });
  writer.Close();
  actor.join();
  flusher.join();
}

TEST_F(ReplayOverSocket, AWriterOfAnotherLayoutIsRefusedForGood) {
  StartServer();
  WriterOptions writer_options = Writer();
  writer_options.layout.observation_width = 5;
  TransitionWriter writer(writer_options);
  const Rows rows(writer_options.layout, 1, 1);
  ASSERT_TRUE(
      writer.Append(rows.columns().Row(writer_options.layout, 0), 1, 1, std::nullopt, kPatience).ok());
  const absl::Status refused = writer.Flush(kPatience);
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(refused.ToString(), HasSubstr("observation_width: expected 4, found 5"));
  EXPECT_EQ(writer.Append(rows.columns().Row(writer_options.layout, 0), 1, 1, std::nullopt, kPatience),
            refused);
  EXPECT_EQ(
      writer.Append(Rows(kSmallLayout, 1, 1).columns().Row(kSmallLayout, 0), 1, 1, std::nullopt, kPatience)
          .code(),
      absl::StatusCode::kInvalidArgument);
}

TEST_F(ReplayOverSocket, ADrawThatWaitsInVainSaysForWhat) {
  options_.buffer.limiter.min_size = 77;
  StartServer();
  ReplayClient client(options_.server.address);
  DrawnBatches drawn;
  const absl::Status status = client.Sample({.uniform = 8}, kSmallLayout, absl::Milliseconds(1), &drawn);
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(status.ToString(),
              AllOf(HasSubstr("rate limiter"), HasSubstr("min_size 77"), HasSubstr("inserted 0")));
}

TEST_F(ReplayOverSocket, StatsTellWhoIsBlockedAndWhy) {
  options_.buffer.limiter.min_size = 77;
  StartServer();
  ReplayClient client(options_.server.address);
  std::thread learner([&] {
    DrawnBatches drawn;
    EXPECT_EQ(client.Sample({.uniform = 8}, kSmallLayout, absl::InfiniteDuration(), &drawn).code(),
              absl::StatusCode::kCancelled);
  });
  StatsReply stats;
  while (stats.blocked_size() == 0) stats = Stats();
  EXPECT_EQ(stats.blocked(0).call(), "sample");
  EXPECT_EQ(stats.blocked(0).clients(), 1u);
  EXPECT_THAT(stats.blocked(0).why(), HasSubstr("min_size 77"));
  client.Close();
  learner.join();
  DrawnBatches drawn;
  EXPECT_EQ(client.Sample({.uniform = 8}, kSmallLayout, kPatience, &drawn).code(),
            absl::StatusCode::kCancelled);
}

TEST_F(ReplayOverSocket, StoppingAnswersADrawThatWaits) {
  options_.buffer.limiter.min_size = 77;
  StartServer();
  ReplayClient client(options_.server.address);
  std::thread learner([&] {
    DrawnBatches drawn;
    const absl::Status status = client.Sample({.uniform = 8}, kSmallLayout, absl::InfiniteDuration(), &drawn);
    EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable) << status;
  });
  while (Stats().blocked_size() == 0) {
  }
  StopServer();
  learner.join();
}

TEST_F(ReplayOverSocket, StoppingKeepsWhatABlockedInsertHasStored) {
  options_.buffer.limiter = {.samples_per_insert = 1, .tolerance = 5, .min_size = 5};
  StartServer();
  TransitionWriter writer(Writer());
  ASSERT_TRUE(Append(&writer, 1, 100).ok());
  StatsReply stats;
  while (stats.blocked_size() == 0) stats = Stats();
  EXPECT_EQ(stats.blocked(0).call(), "insert");
  EXPECT_THAT(stats.blocked(0).why(), HasSubstr("tolerance 5"));
  StopServer();
  options_.buffer.limiter = {};
  options_.store.resume = true;
  StartServer();
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  EXPECT_EQ(Stats().inserted(), 100u);
  EXPECT_EQ(Stats().writers(0).last_sequence(), 100u);
}

TEST_F(ReplayOverSocket, AStartThatFailsLeavesNoStore) {
  StartServer();
  ReplayServerOptions second = options_;
  second.store.path += ".2";
  EXPECT_EQ(ReplayServer::Start(second).status().code(),
            absl::StatusCode::kAlreadyExists);  // the address is in use
  EXPECT_NE(access(second.store.path.c_str(), F_OK), 0);
  EXPECT_EQ(ReplayServer::Start(options_).status().code(),
            absl::StatusCode::kAlreadyExists);  // the store is there
  EXPECT_EQ(access(options_.store.path.c_str(), F_OK), 0);
}

TEST_F(ReplayOverSocket, WithoutAServerCallsFailAtOnce) {
  ReplayClient client(options_.server.address);
  EXPECT_EQ(client.Stats(kPatience).status().code(), absl::StatusCode::kUnavailable);
}

TEST_F(ReplayOverSocket, RelabelsReachTheBuffer) {
  StartServer();
  TransitionWriter writer(Writer());
  ASSERT_TRUE(Append(&writer, 1, 10).ok());
  ASSERT_TRUE(writer.Flush(kPatience).ok());
  ReplayClient client(options_.server.address);
  const std::vector<std::uint64_t> keys = {1, 2, 3, 99};
  const std::vector<float> advantages = {1, -1, std::nanf(""), 1};
  const auto reply = client.Relabel(3, keys, advantages, kPatience);
  ASSERT_TRUE(reply.ok()) << reply.status();
  EXPECT_EQ(reply->relabelled(), 2u);
  EXPECT_EQ(reply->refused(), 1u);
  EXPECT_EQ(reply->evicted(), 1u);
  const StatsReply stats = Stats();
  EXPECT_EQ(stats.plus(), 1u);
  EXPECT_EQ(stats.minus(), 1u);
  EXPECT_EQ(stats.unjudged(), 8u);
  std::vector<std::string> calls;
  for (const LatencyStats& latency : stats.latencies()) {
    calls.push_back(latency.call());
    EXPECT_TRUE(latency.call() != "relabel" || latency.count() == 1);
  }
  EXPECT_THAT(calls, ::testing::ElementsAre("insert", "sample", "relabel", "stats"));
}

}  // namespace
}  // namespace dbr
