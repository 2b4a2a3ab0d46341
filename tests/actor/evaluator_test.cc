#include "actor/evaluator.h"

#include <cmath>
#include <vector>

#include "actor/vector_env.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/line_env.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

// More episodes than one group has, and not a multiple of that.
constexpr int kEpisodes = 150;

TEST(EvaluatorTest, ResultsDoNotDependOnTheNumberOfThreads) {
  const auto policy = UntrainedPolicy(Connect4Spec(), 1);
  for (const ActingMode mode : {MODE, SAMPLE, GREEDY_Q}) {
    EvaluationOptions options = {
        .opponent = "random", .episodes = kEpisodes, .seed = 3, .mode = mode, .threads = 1};
    const EvaluationResult one = Evaluate(*policy, options).value();
    for (const int threads : {0, 2, 3, 16}) {
      options.threads = threads;
      const EvaluationResult several = Evaluate(*policy, options).value();
      EXPECT_EQ(one.score_mean, several.score_mean);
      EXPECT_EQ(one.score_stderr, several.score_stderr);
      EXPECT_EQ(one.return_mean, several.return_mean);
    }
  }
}

TEST(EvaluatorTest, AgreesWithEpisodesPlayedOneByOneFromTheirSeeds) {
  constexpr std::uint64_t kSeed = 5;
  const auto policy = UntrainedPolicy(Connect4Spec(), 2);
  const EvaluationOptions options = {
      .opponent = "one_ply", .episodes = kEpisodes, .seed = kSeed, .mode = MODE};
  const EvaluationResult together = Evaluate(*policy, options).value();

  const auto alone = VectorEnv::Create({.name = "connect4", .opponents = {"one_ply"}}, 1).value();
  PolicyRunner runner;
  Rng unused(0);
  MatrixX<float> action(1, 1);
  std::vector<double> scores, returns, lengths;
  for (int k = 0; k < kEpisodes; ++k) {
    alone->Reset(0, kSeed * (1 << 20) + k);
    EXPECT_EQ(alone->observations().sum(), k % 2) << "the agent starts where the seed is even";
    lengths.push_back(0);
    do {
      ++lengths.back();
      ASSERT_TRUE(runner.Act(*policy, MODE, alone->observations(), alone->masks(), unused, action).ok());
      alone->Step(0, action);
      alone->Advance();
    } while (!alone->results()[0].done());
    scores.push_back(alone->results()[0].score);
    returns.push_back(alone->results()[0].reward);
  }
  EXPECT_EQ(together.score_mean, EstimateMean(scores).mean);
  EXPECT_EQ(together.score_stderr, EstimateMean(scores).standard_error);
  EXPECT_EQ(together.return_mean, EstimateMean(returns).mean);
  EXPECT_EQ(together.return_stderr, EstimateMean(returns).standard_error);
  EXPECT_DOUBLE_EQ(together.return_std, EstimateMean(returns).standard_error * std::sqrt(kEpisodes));
  EXPECT_EQ(together.return_min, -1);
  EXPECT_EQ(together.return_max, 1);
  EXPECT_EQ(together.length_mean, EstimateMean(lengths).mean);
}

TEST(EvaluatorTest, NamesWhatItPlayed) {
  const EvaluationResult result =
      Evaluate(*UntrainedPolicy(Connect4Spec(), 1), {.opponent = "mcts:5", .episodes = 7, .seed = 9}).value();
  EXPECT_EQ(result.env, "connect4");
  EXPECT_EQ(result.opponent, "mcts:5");
  EXPECT_EQ(result.episodes, 7);
  EXPECT_EQ(result.seed, 9);
  EXPECT_NEAR(result.return_mean, 2 * result.score_mean - 1, 1e-12);
}

TEST(EvaluatorTest, AnotherSeedPlaysOtherEpisodes) {
  const auto policy = UntrainedPolicy(Connect4Spec(), 1);
  const auto score = [&](std::uint64_t seed) {
    return Evaluate(*policy, {.opponent = "random", .episodes = kEpisodes, .seed = seed}).value().score_mean;
  };
  EXPECT_EQ(score(1), score(1));
  EXPECT_TRUE(score(1) != score(2) || score(2) != score(3));
}

TEST(EvaluatorTest, StandardErrorIsThatOfTheMean) {
  // Mean 2.5; squared deviations 2.25 + 0.25 + 0.25 + 2.25 = 5; variance 5 / 3; error sqrt(5 / 3 / 4).
  const MeanEstimate estimate = EstimateMean({1, 2, 3, 4});
  EXPECT_DOUBLE_EQ(estimate.mean, 2.5);
  EXPECT_DOUBLE_EQ(estimate.standard_error, std::sqrt(5.0 / 12));
}

TEST(EvaluatorTest, AnUnknownErrorIsNotANumber) {
  const std::vector<double> one = {0.5};
  EXPECT_EQ(EstimateMean(one).mean, 0.5);
  EXPECT_TRUE(std::isnan(EstimateMean(one).standard_error));
  EXPECT_TRUE(std::isnan(EstimateMean({}).mean));
}

TEST(EvaluatorTest, SeveralOpponentsAreMetInTurn) {
  const auto policy = UntrainedPolicy(Connect4Spec(), 1);
  const EvaluationOptions options{.opponent = "", .episodes = 5, .seed = 2};
  const auto results = EvaluateAgainst(*policy, {"one_ply", "random"}, options);
  ASSERT_TRUE(results.ok()) << results.status();
  ASSERT_EQ(results->size(), 2);
  EXPECT_EQ((*results)[0].opponent, "one_ply");
  const auto random = Evaluate(*policy, {.opponent = "random", .episodes = 5, .seed = 2});
  EXPECT_EQ((*results)[1].score_mean, random->score_mean);
  EXPECT_THAT(std::string(EvaluateAgainst(*policy, {"random", "nobody"}, options).status().message()),
              HasSubstr("nobody"));
}

TEST(EvaluatorTest, StopsWhenCancelled) {
  const std::atomic<bool> cancelled = true;
  const auto result = Evaluate(*UntrainedPolicy(Connect4Spec(), 1), {.opponent = "random"}, &cancelled);
  EXPECT_TRUE(absl::IsCancelled(result.status())) << result.status();
}

TEST(EvaluatorTest, RefusesWhatItCannotPlay) {
  const auto policy = UntrainedPolicy(Connect4Spec(), 1);
  const auto message_of = [](const absl::StatusOr<EvaluationResult>& result) {
    EXPECT_TRUE(absl::IsInvalidArgument(result.status())) << result.status();
    return std::string(result.status().message());
  };
  EXPECT_THAT(message_of(Evaluate(*policy, {.opponent = "mcts:many"})), HasSubstr("mcts:many"));
  EXPECT_THAT(message_of(Evaluate(*policy, {.opponent = "random", .episodes = 0})), HasSubstr("episodes"));
  EXPECT_THAT(message_of(Evaluate(*policy, {.opponent = "random", .mode = SUPPORT})), HasSubstr("beta"));

  EXPECT_THAT(message_of(Evaluate(*UntrainedPolicy(LineEnv().spec(), 1), {})), HasSubstr("line"));
  EnvSpec smaller = Connect4Spec();
  smaller.observation_size = 42;
  EXPECT_THAT(message_of(Evaluate(*UntrainedPolicy(smaller, 1), {.opponent = "random"})),
              HasSubstr("observation_size: expected 84, found 42"));
}

}  // namespace
}  // namespace dbr
