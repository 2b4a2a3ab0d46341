// Tests what an actor's transitions carry when they arrive: returns, and the sums of several steps.
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "tests/actor/actor_fixture.h"
#include "tests/actor/line_env.h"
#include "tests/actor/plain_n_step.h"

namespace dbr {
namespace {

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
  const TransitionLayout layout = TransitionLayout::Of(Connect4Spec(), {.returns = true});
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
  const TransitionLayout layout = TransitionLayout::Of(env, {.returns = true});
  TransitionWriter writer({.address = replay_address_, .name = "actor-0", .layout = layout});
  StepLoop loop(MakeLines(10), {.discount = 0.9, .columns = {.returns = true}}, Rng(1),
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

}  // namespace
}  // namespace dbr
