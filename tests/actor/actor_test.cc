// Tests the actor with a real replay server and a double of the learner, over unix sockets.
#include "actor/actor.h"

#include <cmath>

#include "core/monotonic_clock.h"
#include "tests/actor/actor_fixture.h"
#include "tests/actor/line_env.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

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
