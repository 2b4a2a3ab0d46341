// Tests the actor with a real replay server and a double of the learner, over unix sockets.
#include "actor/actor.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <thread>
#include <vector>

#include "core/monotonic_clock.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "proto/config/config_file.h"
#include "replay/client/client.h"
#include "replay/service/replay_server.h"
#include "tests/actor/learner_double.h"
#include "tests/actor/line_env.h"
#include "tests/actor/plain_n_step.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr absl::Duration kLong = absl::Seconds(30);  // reached only where a test fails

// As many transitions are drawn as are inserted, so that a test can wait for inserts by drawing.
constexpr int kDrawn = 1000;

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
        OptionsFrom(config_, TransitionLayout::Of(env, NeedsReturns(config_.algorithm())));
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
    ASSERT_THAT(stats.writers, SizeIs(1));
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

TEST_F(ActorTest, AllThatTheStepLoopSaysArrivesOnce) {
  const EnvSpec env = LineEnv().spec();
  config_.mutable_replay()->set_samples_per_insert(0);
  const auto server = StartReplay(env);
  TransitionWriter writer({.address = replay_address_,
                           .name = "actor-0",
                           .layout = TransitionLayout::Of(env),
                           .batch_bytes = 1024,
                           .buffered_transitions = 300});
  std::uint64_t episodes = 0, plus = 0, minus = 0, unjudged = 0;
  double returns = 0;
  StepLoop loop(MakeLines(10), {.exploration = {.epsilon = 0.2}}, Rng(1),
                [&](const TransitionView& transition, float advantage, std::uint64_t version,
                    const std::optional<EpisodeEnd>& end) {
                  plus += advantage >= 0;
                  minus += advantage <= 0;
                  unjudged += std::isnan(advantage);
                  episodes += end.has_value();
                  if (end.has_value()) returns += end->episode_return;
                  return writer.Append(transition, advantage, version, end, kLong);
                });
  // The critics come later, as in an algorithm that starts without them. The episodes are fewer than the
  // 1,000 that the statistics cover.
  const auto blind = UntrainedPolicy(env, 1, /*with_critics=*/false), judging = UntrainedPolicy(env, 2);
  for (int step = 0; step < 200; ++step) ASSERT_TRUE(loop.Step(step < 50 ? *blind : *judging).ok());
  ASSERT_TRUE(writer.Flush(kLong).ok());

  const BufferStats stats = server->buffer().Stats();
  ExpectEachOnce(stats, 2000);
  EXPECT_EQ(stats.counters.duplicates, 0);
  EXPECT_EQ(stats.plus, plus);
  EXPECT_EQ(stats.minus, minus);
  EXPECT_EQ(stats.unjudged, unjudged);
  EXPECT_EQ(unjudged, 500);
  EXPECT_EQ(stats.counters.episodes, episodes);
  EXPECT_EQ(loop.counters().episodes, episodes);
  EXPECT_NEAR(stats.recent_return_mean, returns / episodes, 1e-3);
  EXPECT_TRUE(std::isnan(stats.recent_score_mean));
  EXPECT_EQ(stats.counters.newest_label, 2);
}

TEST_F(ActorTest, WritesUntilItIsStoppedAndLeavesNothingBehind) {
  const auto server = StartReplay(Connect4Spec());
  LearnerDouble learner(learner_address_);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  const auto actor = MakeActor();
  RunningActor running(actor.get());
  ASSERT_TRUE(AwaitInserted(3000));
  const absl::Status status = running.Stop([this] { MakeRoom(); });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(actor->counters().acknowledged, actor->counters().appended);
  const BufferStats stats = server->buffer().Stats();
  ExpectEachOnce(stats, actor->counters().appended);
  EXPECT_EQ(stats.writers[0].identity.name, "actor-3");
  EXPECT_EQ(stats.unjudged, 0);
  EXPECT_NEAR(stats.recent_return_mean, 2 * stats.recent_score_mean - 1, 1e-9);
}

// Connect-4 gives a reward only at the end, and an episode has at most 21 moves of the agent.
TEST_F(ActorTest, TransitionsArriveWithTheirReturnsWhereTheAdvantageIsTheirs) {
  config_.mutable_algorithm()->mutable_dbr()->set_advantage(DbrConfig::SIL);
  config_.mutable_algorithm()->set_discount(0.5);
  const auto server = StartReplay(Connect4Spec());
  LearnerDouble learner(learner_address_);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  const auto actor = MakeActor();
  RunningActor running(actor.get());
  DrawnBatches drawn;
  const TransitionLayout layout = TransitionLayout::Of(Connect4Spec(), /*with_returns=*/true);
  const absl::Status sampled = client_->Sample({.uniform = kDrawn}, layout, kLong, &drawn);
  ASSERT_TRUE(sampled.ok()) << sampled;
  EXPECT_EQ(drawn.unjudged_size, 0u);
  int paid = 0;
  for (int i = 0; i < kDrawn; ++i) {
    const float value = drawn.uniform.returns[i];
    if (drawn.uniform.discounts[i] == 0) {
      ASSERT_EQ(value, drawn.uniform.rewards[i]);
    } else if (value != 0) {
      const float moves = -std::log2(std::abs(value));  // the number of moves to the last one
      ASSERT_EQ(moves, std::round(moves));
      ASSERT_TRUE(moves >= 1 && moves <= 20) << value;
      ++paid;
    }
  }
  EXPECT_GT(paid, kDrawn / 10);
  const absl::Status status = running.Stop(
      [&] { client_->Sample({.uniform = kDrawn}, layout, absl::Seconds(1), &drawn).IgnoreError(); });
  EXPECT_TRUE(status.ok()) << status;
  ExpectEachOnce(server->buffer().Stats(), actor->counters().appended);
}

// Follows episodes, cut ones too, on the whole way from a step to a draw, over a real socket.
TEST_F(ActorTest, ADrawnReturnIsThatOfItsEpisode) {
  const EnvSpec env = LineEnv().spec();
  config_.mutable_algorithm()->mutable_dbr()->set_advantage(DbrConfig::SIL);
  config_.mutable_replay()->set_samples_per_insert(0);
  const auto server = StartReplay(env);
  const TransitionLayout layout = TransitionLayout::Of(env, /*with_returns=*/true);
  TransitionWriter writer({.address = replay_address_, .name = "actor-0", .layout = layout});
  StepLoop loop(MakeLines(10), {.discount = 0.9, .with_returns = true}, Rng(1),
                [&](const TransitionView& transition, float advantage, std::uint64_t version,
                    const std::optional<EpisodeEnd>& end) {
                  return writer.Append(transition, advantage, version, end, kLong);
                });
  const auto policy = UntrainedPolicy(env, 1);
  for (int step = 0; step < 100; ++step) ASSERT_TRUE(loop.Step(*policy).ok());
  ASSERT_TRUE(writer.Flush(kLong).ok());
  DrawnBatches drawn;
  ASSERT_TRUE(client_->Sample({.uniform = 5000}, layout, kLong, &drawn).ok());
  EXPECT_EQ(drawn.total_size + loop.held_back(), 1000u);
  // Keys follow the order of the inserts, so an episode's rows have neighbouring keys.
  std::map<std::uint64_t, int> column_of;
  const Batch& rows = drawn.uniform;
  for (int i = 0; i < rows.size(); ++i) column_of[rows.keys[i]] = i;
  int compared = 0, cut = 0;
  for (const auto& [key, i] : column_of) {
    const auto seed = static_cast<std::uint64_t>(rows.observations(0, i));
    const bool last = rows.observations(1, i) + 1 == static_cast<float>(LineEnv::LengthOf(seed));
    double behind = 0;
    if (last && LineEnv::IsCut(seed)) {
      PolicyRunner runner;
      const PolicyView& view = runner.View(*policy, rows.next_observations.col(i), rows.next_masks.col(i));
      behind = view.policy.col(0).dot(view.q.col(0));
      ++cut;
    } else if (!last) {
      const auto next = column_of.find(key + 1);
      if (next == column_of.end()) continue;
      behind = rows.returns[next->second];
    }
    const double expected = rows.rewards[i] + rows.discounts[i] * behind;
    EXPECT_NEAR(rows.returns[i], expected, 1e-6 * (1 + std::abs(expected)));  // the precision of a float
    ++compared;
  }
  EXPECT_GT(compared, 800);
  EXPECT_GT(cut, 50);
}

// The game is the agent's own moves: a transition of several moves has the result where it reaches the end.
TEST_F(ActorTest, TransitionsOfSeveralStepsArriveAsThePlainLoopMakesThem) {
  constexpr std::size_t kCompared = 2000;
  config_.mutable_algorithm()->set_discount(0.5);
  const TransitionLayout layout = TransitionLayout::Of(Connect4Spec());
  // The first rows in the store of an actor that makes transitions of `n` steps.
  const auto rows_of = [&](std::uint32_t n) {
    config_.mutable_algorithm()->set_n_step(n);
    auto server = StartReplay(Connect4Spec());
    LearnerDouble learner(learner_address_);
    learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
    const auto actor = MakeActor();
    RunningActor running(actor.get());
    client_ = std::make_unique<ReplayClient>(replay_address_);
    EXPECT_TRUE(AwaitInserted(3000));
    EXPECT_TRUE(running.Stop([this] { MakeRoom(); }).ok());
    const BufferStats stats = server->buffer().Stats();
    ExpectEachOnce(stats, actor->counters().appended);
    EXPECT_GT(stats.counters.episodes, 0u);
    EXPECT_NEAR(stats.recent_return_mean, 2 * stats.recent_score_mean - 1, 1e-9);
    server.reset();
    const std::string path = folder_.path() + "/replay.store";
    const auto store = TransitionStore::Open(
        {.path = path, .env = "connect4", .layout = layout, .capacity = 50000, .resume = true});
    EXPECT_TRUE(store.ok()) << store.status();
    std::vector<std::vector<float>> rows;
    for (std::uint32_t slot = 0; slot < (*store)->size(); ++slot)
      rows.emplace_back((*store)->row(slot), (*store)->row(slot) + layout.stride());
    std::filesystem::remove(path);
    return rows;
  };
  const std::vector<std::vector<float>> single = rows_of(1), several = rows_of(3);
  const auto ends = [&](std::size_t j) { return single[j][layout.discount_offset()] == 0; };
  const std::vector<PlainNStep> plain = PlainNSteps(single.size(), 8, 3, ends);
  ASSERT_GT(std::min(plain.size(), several.size()), kCompared);
  int results = 0;
  for (std::size_t i = 0; i < kCompared; ++i) {
    const std::vector<float>& last = single[plain[i].steps.back()];
    std::vector<float> expected = single[plain[i].steps.front()];
    float reward = 0, discount = 1;  // exact, for the game has no reward before its end
    for (const std::size_t j : plain[i].steps) {
      reward += discount * single[j][layout.reward_offset()];
      discount *= 0.5f;
    }
    expected[layout.reward_offset()] = reward;
    expected[layout.discount_offset()] = ends(plain[i].steps.back()) ? 0 : discount;
    std::copy(last.begin() + layout.next_observation_offset(), last.end(),
              expected.begin() + layout.next_observation_offset());
    ASSERT_EQ(several[i], expected) << "row " << i;
    results += std::abs(reward) == 0.25f;
  }
  EXPECT_GT(results, 20);
}

TEST_F(ActorTest, GoesOnWhenTheLearnerAndTheReplayServerGoAwayAndComeBack) {
  auto server = StartReplay(Connect4Spec());
  auto learner = std::make_unique<LearnerDouble>(learner_address_);
  learner->Offer(Encode(UntrainedSnapshot(Connect4Spec(), 5)));
  const auto actor = MakeActor();
  RunningActor running(actor.get());
  ASSERT_TRUE(AwaitInserted(2000));

  learner.reset();
  ASSERT_TRUE(AwaitInserted(4000));

  ASSERT_TRUE(server->Stop().ok());
  server.reset();
  server = StartReplay(Connect4Spec(), /*resume=*/true);
  client_ = std::make_unique<ReplayClient>(replay_address_);
  ASSERT_TRUE(AwaitInserted(8000));

  learner = std::make_unique<LearnerDouble>(learner_address_);
  learner->Offer(Encode(UntrainedSnapshot(Connect4Spec(), 6)));
  while (server->buffer().Stats().counters.newest_label < 6) ASSERT_TRUE(AwaitInserted(0));

  const absl::Status status = running.Stop([this] { MakeRoom(); });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(actor->counters().reconnects, 1);
  EXPECT_EQ(actor->counters().acknowledged, actor->counters().appended);
  ExpectEachOnce(server->buffer().Stats(), actor->counters().appended);
}

TEST_F(ActorTest, StopsWithinItsDeadlineWhileTheReplayServerIsAway) {
  LearnerDouble learner(learner_address_);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  const auto actor = MakeActor(/*drain_timeout=*/absl::Milliseconds(10));
  RunningActor running(actor.get());
  const absl::Time deadline = MonotonicNow() + kLong;
  while (actor->counters().appended < 500 && MonotonicNow() < deadline) std::this_thread::yield();
  const absl::Status status = running.Stop();
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(actor->counters().appended, 500) << "as many as it may buffer";
  EXPECT_EQ(actor->counters().acknowledged, 0);
}

TEST_F(ActorTest, EndsWithTheErrorOfAPolicyForSomethingElse) {
  LearnerDouble learner(learner_address_);
  learner.Offer(Encode(UntrainedSnapshot(LineEnv().spec(), 1)));
  const absl::Status status = MakeActor()->Run();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("env: expected connect4, found line"));
}

TEST_F(ActorTest, EndsWithTheErrorOfAReplayServerForSomethingElse) {
  const auto server = StartReplay(LineEnv().spec());
  LearnerDouble learner(learner_address_);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  const absl::Status status = MakeActor()->Run();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("observation_width"));
}

TEST_F(ActorTest, AnActorThatStartsLaterGoesOnWithTheEpsilonOfTheRun) {
  config_.mutable_replay()->set_samples_per_insert(0);
  config_.mutable_replay()->set_capacity(2000);
  config_.mutable_actor()->set_mode(MODE);
  config_.mutable_actor()->set_epsilon(1);
  config_.mutable_actor()->set_final_epsilon(0);
  const auto server = StartReplay(Connect4Spec());
  LearnerDouble learner(learner_address_);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  const auto act_until = [&](std::uint64_t inserted) {
    const auto actor = MakeActor();
    RunningActor running(actor.get());
    EXPECT_TRUE(AwaitInserted(inserted));
    EXPECT_TRUE(running.Stop().ok());
  };
  act_until(30000);
  const std::uint64_t inserted = server->buffer().Stats().inserted;
  config_.mutable_actor()->set_epsilon_decay_steps(inserted);
  act_until(inserted + 2000);

  DrawnBatches drawn;
  ASSERT_TRUE(client_->Sample({.uniform = kDrawn}, TransitionLayout::Of(Connect4Spec()), kLong, &drawn).ok());
  MatrixX<float> best(1, kDrawn);
  Rng unused(1);
  ASSERT_TRUE(PolicyRunner()
                  .Act(*UntrainedPolicy(Connect4Spec(), 1), MODE, drawn.uniform.observations,
                       drawn.uniform.masks, unused, best)
                  .ok());
  EXPECT_EQ(drawn.uniform.actions, best);
}

TEST_F(ActorTest, RefusesNoiseOnDiscreteActions) {
  config_.mutable_actor()->set_action_noise(0.1);
  const absl::Status status =
      Actor::Create(
          {.config = config_, .replay_address = replay_address_, .learner_address = learner_address_})
          .status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("discrete actions of environment 'connect4'"));
}

TEST_F(ActorTest, RefusesAnUnknownOpponent) {
  config_.mutable_env()->add_opponents("nobody");
  const absl::Status status =
      Actor::Create(
          {.config = config_, .replay_address = replay_address_, .learner_address = learner_address_})
          .status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("nobody"));
}

}  // namespace
}  // namespace dbr
