#include "replay/client/await_stats.h"

#include <gtest/gtest.h>

#include <thread>

#include "absl/strings/str_cat.h"
#include "core/stop_flag.h"
#include "proto/rpc/server.h"
#include "replay/client/client.h"
#include "replay/service/replay_server.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

class AwaitStatsTest : public testing::Test {
 protected:
  AwaitStatsTest() {
    options_.store.layout = kSmallLayout;
    options_.store.capacity = 10000;
    options_.server.address = absl::StrCat("unix:", folder_.path(), "/replay.sock");
  }

  TestFolder folder_;
  ReplayServerOptions options_;
};

TEST_F(AwaitStatsTest, StatisticsAreAwaitedUntilThereIsAServer) {
  const StopFlag never;
  std::thread process([&] {
    ReplayClient client(options_.server.address);
    const auto stats = AwaitStats(&client, "for this test", never);
    EXPECT_TRUE(stats.ok() && stats->capacity() == 10000) << stats.status();
  });
  const auto server = ReplayServer::Start(options_);
  EXPECT_TRUE(server.ok()) << server.status();
  process.join();
}

TEST_F(AwaitStatsTest, AwaitingStatisticsEndsWithTheProcessAndBeforeAnotherProgram) {
  ReplayClient client(options_.server.address);
  StopFlag stopping;
  std::thread process(
      [&] { EXPECT_TRUE(absl::IsCancelled(AwaitStats(&client, "for this test", stopping).status())); });
  stopping.Set();
  process.join();
  const auto another = StartServer(options_.server, {});
  ASSERT_TRUE(another.ok()) << another.status();
  const StopFlag never;
  EXPECT_TRUE(absl::IsUnimplemented(AwaitStats(&client, "for this test", never).status()));
}

}  // namespace
}  // namespace dbr
