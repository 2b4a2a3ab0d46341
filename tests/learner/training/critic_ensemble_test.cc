#include "learner/training/critic_ensemble.h"

#include <gtest/gtest.h>

#include <set>
#include <utility>
#include <vector>

namespace dbr {
namespace {

using Matrix = MatrixX<double>;

class CriticEnsembleTest : public testing::Test {
 protected:
  CriticEnsemble<double> Make(const CriticCounts& counts) {
    Rng rng(3);
    return CriticEnsemble<double>(MlpShape(4, {6}, 1), {.learning_rate = 1e-2, .with_target = true}, rng,
                                  &runner_, counts);
  }
  // A step of all critics towards 1.
  double Fit(CriticEnsemble<double>* critics) {
    return critics->Fit(x_, [](const Matrix& q, Matrix* d_q) {
      *d_q = (q.array() - 1).matrix();
      return d_q->squaredNorm();
    });
  }
  static std::vector<std::vector<float>> Parameters(const CriticEnsemble<double>& critics) {
    TensorFile file;
    critics.Save(&file);
    std::vector<std::vector<float>> parameters;
    for (int i = 1; file.tensors.count(absl::StrCat("critic_", i)) > 0; ++i) {
      parameters.push_back(file.tensors.at(absl::StrCat("critic_", i)));
    }
    return parameters;
  }

  PairRunner runner_{1};
  Rng rng_{5};
  const Matrix x_ = Matrix::NullaryExpr(4, 8, [this] { return rng_.Normal(); });
};

TEST_F(CriticEnsembleTest, AStepTrainsEveryCritic) {
  CriticEnsemble<double> critics = Make({.critics = 5});
  const auto before = Parameters(critics);
  ASSERT_EQ(before.size(), 5u);
  Fit(&critics);
  const auto after = Parameters(critics);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NE(before[i], after[i]) << i;
}

TEST_F(CriticEnsembleTest, EveryPairOfCriticsIsAskedAndNeverOneTwice) {
  CriticEnsemble<double> critics = Make({.critics = 4});
  Rng rng(7);
  std::set<std::pair<double, double>> pairs;
  for (int i = 0; i < 400; ++i) {
    critics.ChooseTwins(rng);
    critics.Evaluate(x_);
    EXPECT_NE(critics.value1()(0, 0), critics.value2()(0, 0));
    pairs.insert({critics.value1()(0, 0), critics.value2()(0, 0)});
  }
  EXPECT_EQ(pairs.size(), 12u);  // ordered pairs of 4
}

TEST_F(CriticEnsembleTest, AllValuesOfAnUpdateAreTheSameTwins) {
  CriticEnsemble<double> critics = Make({.critics = 4});
  Rng rng(8);
  for (int i = 0; i < 10; ++i) {
    critics.ChooseTwins(rng);
    critics.Evaluate(x_);
    critics.EvaluateTargets(x_);  // a new critic's target is the critic
    EXPECT_EQ(critics.value1(), critics.target1());
    EXPECT_EQ(critics.value2(), critics.target2());
  }
  Fit(&critics);
  EXPECT_EQ(critics.q1(), critics.target1());  // from before the step
  EXPECT_EQ(critics.q2(), critics.target2());
}

TEST_F(CriticEnsembleTest, TwoCriticsLeaveTheGeneratorAlone) {
  CriticEnsemble<double> critics = Make({});
  Rng rng(9), untouched(9);
  critics.ChooseTwins(rng);
  EXPECT_EQ(rng(), untouched());
}

TEST_F(CriticEnsembleTest, OneCriticIsBothTwins) {
  for (const int count : {1, 3}) {
    CriticEnsemble<double> critics = Make({.critics = count, .asked = 1});
    Rng rng(2);
    critics.ChooseTwins(rng);
    critics.Evaluate(x_);
    EXPECT_EQ(critics.value1(), critics.value2());
    // Both gradients reach the input.
    const Matrix ones = Matrix::Ones(1, 8), none = Matrix::Zero(1, 8);
    const Matrix once = critics.InputGradient(ones, none, 2);
    EXPECT_TRUE(critics.InputGradient(ones, ones, 2).isApprox(2 * once, 1e-12));
    EXPECT_FALSE(once.isZero(0));
  }
}

TEST_F(CriticEnsembleTest, ALoadNamesACriticThatIsMissing) {
  TensorFile file;
  Make({}).Save(&file);
  CriticEnsemble<double> four = Make({.critics = 4});
  const absl::Status status = four.Load(file);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_NE(std::string(status.message()).find("critic_3"), std::string::npos) << status;
}

}  // namespace
}  // namespace dbr
