// An actor in a thread of its own, a real replay server and a double of the learner, over unix sockets.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "actor/actor.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "proto/config/config_file.h"
#include "replay/client/client.h"
#include "replay/service/replay_server.h"
#include "tests/actor/learner_double.h"
#include "tests/actor/test_policies.h"

namespace dbr {

inline constexpr absl::Duration kLong = absl::Seconds(30);  // reached only where a test fails

// As many transitions are drawn as are inserted, so that a test can wait for inserts by drawing.
inline constexpr int kDrawn = 1000;

// Runs an actor in a thread of its own. Stops and joins it at the end of the test, also when the test fails.
class RunningActor {
 public:
  explicit RunningActor(Actor* actor) : actor_(actor), thread_([this] { status_ = actor_->Run(); }) {}
  ~RunningActor() {
    if (thread_.joinable()) Stop().IgnoreError();
  }

  // Stops the actor while `meanwhile` runs. Returns the status of Run.
  absl::Status Stop(const std::function<void()>& meanwhile = [] {}) {
    actor_->Stop();
    meanwhile();
    thread_.join();
    return status_;
  }

 private:
  Actor* const actor_;
  absl::Status status_;
  std::thread thread_;
};

class ActorTest : public ::testing::Test {
 protected:
  ActorTest() {
    config_.mutable_network()->add_hidden_sizes(16);
    config_.mutable_network()->add_hidden_sizes(16);
    config_.mutable_actor()->set_envs(8);
    config_.mutable_actor()->set_buffered_transitions(500);
    config_.mutable_actor()->set_batch_bytes(4096);
    config_.mutable_replay()->set_capacity(50000);
    config_.mutable_replay()->set_min_size(100);
    config_.mutable_replay()->set_samples_per_insert(1);
    config_.mutable_replay()->set_tolerance(kDrawn);
  }

  std::unique_ptr<ReplayServer> StartReplay(const EnvSpec& env, bool resume = false) const {
    ReplayServerOptions options =
        OptionsFrom(config_, TransitionLayout::Of(env, OptionalColumnsOf(config_.algorithm())));
    options.store.path = folder_.path() + "/replay.store";
    options.store.env = env.name;
    options.store.resume = resume;
    options.server.address = replay_address_;
    return ReplayServer::Start(options).value();
  }

  std::unique_ptr<Actor> MakeActor(absl::Duration drain_timeout = kLong) const {
    return Actor::Create({.config = config_,
                          .index = 3,
                          .replay_address = replay_address_,
                          .learner_address = learner_address_,
                          .drain_timeout = drain_timeout})
        .value();
  }

  // Draws until `inserted` transitions have come. Returns false where that takes too long.
  bool AwaitInserted(std::uint64_t inserted) {
    DrawnBatches drawn;
    const TransitionLayout layout = TransitionLayout::Of(Connect4Spec());
    do {
      const absl::Status status = client_->Sample({.uniform = kDrawn}, layout, kLong, &drawn);
      if (!status.ok()) {
        ADD_FAILURE() << status;
        return false;
      }
    } while (drawn.inserted < inserted);
    return true;
  }

  // Lets the limiter accept the transitions that an actor still holds: one draw makes room for more than the
  // actor may buffer. Where the draw must wait, there is room already.
  void MakeRoom() {
    DrawnBatches drawn;
    const absl::Status status =
        client_->Sample({.uniform = kDrawn}, TransitionLayout::Of(Connect4Spec()), absl::Seconds(1), &drawn);
    EXPECT_TRUE(status.ok() || absl::IsDeadlineExceeded(status)) << status;
  }

  // Expects that the server holds each of the `written` transitions of one writer once.
  static void ExpectEachOnce(const BufferStats& stats, std::uint64_t written) {
    ASSERT_THAT(stats.writers, ::testing::SizeIs(1));
    EXPECT_EQ(stats.total, written);
    EXPECT_EQ(stats.writers[0].held, written);
    EXPECT_EQ(stats.writers[0].inserted, written);
    EXPECT_EQ(stats.writers[0].last_sequence, written);
    EXPECT_EQ(stats.evicted, 0);
    EXPECT_EQ(stats.writers[0].refused, 0);
  }

  SocketFolder folder_;
  const std::string replay_address_ = folder_.Address("replay");
  const std::string learner_address_ = folder_.Address("learner");
  Config config_;
  std::unique_ptr<ReplayClient> client_ = std::make_unique<ReplayClient>(replay_address_);
};

}  // namespace dbr
