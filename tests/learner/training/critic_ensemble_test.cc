// Tests any number of critics: which of them an update asks, that all are trained, and their gradients.
#include "learner/training/critic_ensemble.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/rng.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;

constexpr int kInputs = 4, kActionRows = 2, kSamples = 3;

class CriticEnsembleTest : public testing::Test {
 protected:
  CriticEnsembleTest() {
    x_ = Matrix::NullaryExpr(kInputs, kSamples, [&] { return rng_.Normal(); });
  }

  CriticEnsemble<double> Make(int critics, int asked, int threads = 1) {
    PairRunner* const runner = threads == 1 ? &one_thread_ : &two_threads_;
    Rng rng(7);
    CriticEnsemble<double> made(MlpShape(kInputs, {6}, 1), {.learning_rate = 1e-2, .with_target = true}, rng,
                                runner, {.critics = critics, .asked = asked});
    made.set_target_tau(0.5);
    return made;
  }
  static TensorFile StateOf(const CriticEnsemble<double>& critics) {
    TensorFile file;
    critics.Save(&file);
    return file;
  }
  // Makes one step of all critics towards 1. Returns the mean of their losses.
  double Fit(CriticEnsemble<double>* critics) const {
    return critics->Fit(x_, [](const Matrix& q, Matrix* d_q) {
      *d_q = 2 * (q.array() - 1) / kSamples;
      return (q.array() - 1).square().mean();
    });
  }
  // Draws a pair, and evaluates it in each of the three ways. They must be the same two critics: before any
  // step, targets are equal to the online networks. Returns their values of the first sample.
  std::pair<double, double> Ask(CriticEnsemble<double>* critics) {
    critics->ChooseTwins(rng_);
    critics->EvaluateTargets(x_);
    critics->Evaluate(x_);
    EXPECT_EQ(critics->target1(), critics->value1());
    EXPECT_EQ(critics->target2(), critics->value2());
    return {critics->value1()(0, 0), critics->value2()(0, 0)};
  }

  Rng rng_{5};
  Matrix x_;  // [kInputs x kSamples]
  PairRunner one_thread_{1}, two_threads_{2};
};

TEST_F(CriticEnsembleTest, EveryFitTrainsEveryCriticAndItsTarget) {
  for (const int threads : {1, 2}) {
    CriticEnsemble<double> critics = Make(4, 2, threads);
    for (int i = 0; i < 10; ++i) {
      critics.ChooseTwins(rng_);
      const TensorFile before = StateOf(critics);
      Fit(&critics);
      const TensorFile after = StateOf(critics);
      ASSERT_EQ(after.tensors.size(), 16u) << "parameters, target and two moments of each";
      for (const char* critic : {"critic_1", "critic_2", "critic_3", "critic_4"}) {
        EXPECT_NE(after.tensors.at(critic), before.tensors.at(critic)) << critic;
        const std::string target = std::string(critic) + ".target";
        EXPECT_NE(after.tensors.at(target), before.tensors.at(target)) << target;
      }
    }
  }
}

TEST_F(CriticEnsembleTest, TheLossIsTheMeanOverAllCritics) {
  CriticEnsemble<double> critics = Make(4, 2);
  std::map<double, double> losses;  // by the value of the first sample
  while (losses.size() < 4) {
    Ask(&critics);
    for (const Matrix* q : {&critics.value1(), &critics.value2()}) {
      losses[(*q)(0, 0)] = (q->array() - 1).square().mean();
    }
  }
  double mean = 0;
  for (const auto& [value, loss] : losses) mean += loss / 4;
  EXPECT_NEAR(Fit(&critics), mean, 1e-12);
}

TEST_F(CriticEnsembleTest, FitKeepsTheTwinsValuesFromBeforeItsStep) {
  CriticEnsemble<double> critics = Make(4, 2);
  Ask(&critics);
  const Matrix first = critics.value1(), second = critics.value2();
  Fit(&critics);
  EXPECT_EQ(critics.q1(), first);
  EXPECT_EQ(critics.q2(), second);
}

TEST_F(CriticEnsembleTest, ThePairIsDrawnUniformlyFromAllPairs) {
  CriticEnsemble<double> critics = Make(4, 2);
  std::map<std::pair<double, double>, int> counts;
  constexpr int kDraws = 2400;
  for (int i = 0; i < kDraws; ++i) ++counts[Ask(&critics)];
  EXPECT_EQ(counts.size(), 12u) << "ordered pairs of four";
  for (const auto& [pair, count] : counts) {
    EXPECT_NE(pair.first, pair.second) << "a critic is its own twin";
    EXPECT_NEAR(count, kDraws / 12, 75);  // five standard deviations
  }
}

TEST_F(CriticEnsembleTest, WithOneAskedBothTwinsAreTheSameCriticAndEachHasItsTurn) {
  CriticEnsemble<double> critics = Make(3, 1);
  std::map<double, int> counts;
  for (int i = 0; i < 900; ++i) {
    const auto [first, second] = Ask(&critics);
    EXPECT_EQ(first, second);
    ++counts[first];
  }
  EXPECT_EQ(counts.size(), 3u);
  for (const auto& [value, count] : counts) EXPECT_NEAR(count, 300, 70);
  Fit(&critics);
  EXPECT_EQ(critics.q1(), critics.q2());
  EXPECT_EQ(critics.first().parameters().size(), critics.second().parameters().size());
}

TEST_F(CriticEnsembleTest, WhereThereIsNoChoiceNothingIsDrawn) {
  for (const int count : {1, 2}) {
    CriticEnsemble<double> critics = Make(count, count);
    const Rng::State before = rng_.state();
    const auto first = Ask(&critics);
    for (int i = 0; i < 10; ++i) EXPECT_EQ(Ask(&critics), first);
    EXPECT_EQ(rng_.state(), before) << count;
  }
}

TEST_F(CriticEnsembleTest, TheInputGradientIsThatOfTheDrawnTwins) {
  for (const int asked : {1, 2}) {
    CriticEnsemble<double> critics = Make(4, asked);
    for (int i = 0; i < 5; ++i) {
      Ask(&critics);
      const Matrix d_q1 = Matrix::NullaryExpr(1, kSamples, [&] { return rng_.Normal(); });
      const Matrix d_q2 = Matrix::NullaryExpr(1, kSamples, [&] { return rng_.Normal(); });
      const Matrix both = critics.InputGradient(d_q1, d_q2, kActionRows);
      const Matrix first = critics.FirstInputGradient(d_q1, kActionRows);
      const auto at = [&](const Matrix& actions) -> CriticEnsemble<double>& {
        Matrix moved = x_;
        moved.bottomRows(kActionRows) = actions;
        critics.Evaluate(moved);
        return critics;
      };
      const Matrix actions = x_.bottomRows(kActionRows);
      ExpectIsGradient(
          both,
          [&](const Matrix& moved) {
            const CriticEnsemble<double>& there = at(moved);
            return d_q1.cwiseProduct(there.value1()).sum() + d_q2.cwiseProduct(there.value2()).sum();
          },
          actions);
      ExpectIsGradient(
          first, [&](const Matrix& moved) { return d_q1.cwiseProduct(at(moved).value1()).sum(); }, actions);
    }
  }
}

TEST_F(CriticEnsembleTest, TheStateOfFewerCriticsLacksTheRest) {
  CriticEnsemble<double> two = Make(2, 2), four = Make(4, 2);
  const absl::Status status = four.Load(StateOf(two));
  EXPECT_TRUE(absl::IsDataLoss(status));
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("'critic_3'"));
  EXPECT_TRUE(two.Load(StateOf(four)).ok()) << "the first two of four";
}

}  // namespace
}  // namespace dbr
