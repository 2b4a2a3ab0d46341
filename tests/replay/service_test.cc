// The service, the writer and the client over a real unix socket.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "absl/strings/str_cat.h"
#include "proto/channel.h"
#include "proto/codec.h"
#include "proto/grpc_status.h"
#include "replay/client.h"
#include "replay/replay_server.h"
#include "replay/writer.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

constexpr absl::Duration kPatience = absl::Seconds(60);  // for what must happen; only a failure waits that long
constexpr absl::Duration kNoWait = absl::ZeroDuration();

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
  static absl::Status Append(TransitionWriter* writer, std::uint64_t first, int count, float advantage = kUnjudged,
                             absl::Duration timeout = kPatience) {
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
  const absl::Status status = client.Sample({.uniform = 64, .plus = 32, .minus = 16}, kSmallLayout, kPatience, &drawn);
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

}  // namespace
}  // namespace dbr
