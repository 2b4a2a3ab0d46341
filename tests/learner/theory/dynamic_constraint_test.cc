// Compares DBR's dynamic constraint, on tables, with the paper's set
//   Pi_eps = {pi : pi(a|s) = 0 wherever beta+(a|s) < max(eps, beta-(a|s))}.
//
// What is true about D(pi, beta+) <= c with KL(pi || beta):
//   1. Min, c = min(eps', D(pi, beta-)), admits pi where KL(pi||beta+) <= eps' AND E_pi log(beta+ / beta-) >=
//      0. Max, c = max(eps', D(pi, beta-)), admits pi where one of the two holds. (Each is a mean over the
//      states.)
//   2. A deterministic policy has KL(pi||beta) = -log beta(a|s). So in one state, with eps' = -log eps, min
//      admits exactly the deterministic policies of Pi_eps, those with beta+ >= max(eps, beta-). Max admits
//      those with beta+ >= min(eps, beta-), also outside Pi_eps.
//   3. Min admits all of Pi_eps, stochastic policies too, and also others. KL bounds the mass outside the set
//      and does not forbid it. If beta+ has the share b outside, an admitted pi has there at most the p with
//      p log(p/b) + (1-p) log((1-p)/(1-b)) = eps' (by the chain rule, and by convexity over states). Min
//      always admits beta+ itself, which is in Pi_eps only where b = 0.
//   4. Max has no such bound. Where beta- is smaller still, all of pi may be on an action with beta+ < eps.
#include <gtest/gtest.h>

#include <cmath>

#include "learner/objectives/discrete_losses.h"
#include "learner/training/multiplier.h"
#include "nn/adam.h"
#include "nn/policy.h"
#include "tests/learner/theory/tabular_mdp.h"

namespace dbr::tabular {
namespace {

constexpr int kActions = 3;
constexpr double kEpsilon = 0.05;  // the eps of the set: a density

Categorical<double> SoftmaxOf(const Matrix& logits) {
  Categorical<double> p;
  MaskedSoftmax<double>(logits, Matrix::Ones(logits.rows(), logits.cols()), &p);
  return p;
}

// DBR's policy loss for a policy that is a table of logits, with given Q, beta+ and beta-.
struct TableProblem {
  Matrix plus, minus, q;  // [actions x states]
  double epsilon = 0.05;  // the eps of the constraint: nats

  PolicyLoss<double> Loss(DbrConfig::Constraint constraint, const Categorical<double>& policy, double alpha,
                          Matrix* d_logits) const {
    PolicyLossWorkspace<double> workspace;
    return DualBehaviorPolicyLoss<double>(
        {.constraint = constraint, .epsilon = epsilon}, policy, q, q, SoftmaxOf(plus.array().log().matrix()),
        SoftmaxOf(minus.array().log().matrix()), alpha, &workspace, d_logits);
  }
  bool Admits(DbrConfig::Constraint constraint, const Matrix& logits) const {
    Matrix unused;
    const PolicyLoss<double> loss = Loss(constraint, SoftmaxOf(logits), 1, &unused);
    return loss.divergence_plus <= loss.threshold;
  }
};

// Returns the logits of the deterministic policy that takes `action` in the only state.
Matrix Always(int action) {
  Matrix logits = Matrix::Constant(kActions, 1, -1e4);
  logits(action, 0) = 0;
  return logits;
}

TableProblem RandomTables(int states, Rng& rng) {
  return {.plus = RandomPolicy(states, kActions, 2, rng),
          .minus = RandomPolicy(states, kActions, 2, rng),
          .q = Matrix::Zero(kActions, states)};
}

TEST(DynamicConstraint, MinAdmitsTheDeterministicPoliciesOfTheSetAndNoOthers) {
  Rng rng(1);
  int in_set = 0;
  for (int i = 0; i < 300; ++i) {
    TableProblem problem = RandomTables(1, rng);
    problem.epsilon = -std::log(kEpsilon);
    const Matrix support = SupportOf(problem.plus, problem.minus, kEpsilon);
    for (int a = 0; a < kActions; ++a) {
      EXPECT_EQ(problem.Admits(DbrConfig::DYNAMIC_MIN, Always(a)), support(a, 0) > 0);
      in_set += support(a, 0) > 0;
    }
  }
  EXPECT_GT(in_set, 300);
  EXPECT_LT(in_set, 600);
}

TEST(DynamicConstraint, MaxAdmitsADeterministicPolicyWhereBetaPlusReachesTheSmallerBound) {
  Rng rng(2);
  int outside_set = 0;
  for (int i = 0; i < 300; ++i) {
    TableProblem problem = RandomTables(1, rng);
    problem.epsilon = -std::log(kEpsilon);
    const Matrix support = SupportOf(problem.plus, problem.minus, kEpsilon);
    for (int a = 0; a < kActions; ++a) {
      const bool reaches = problem.plus(a, 0) >= std::min(kEpsilon, problem.minus(a, 0));
      EXPECT_EQ(problem.Admits(DbrConfig::DYNAMIC_MAX, Always(a)), reaches);
      outside_set += reaches && support(a, 0) == 0;
    }
  }
  EXPECT_GT(outside_set, 100);
}

TEST(DynamicConstraint, MinAdmitsEveryPolicyOfTheSet) {
  Rng rng(3);
  int tried = 0;
  while (tried < 300) {
    const int states = 4 + static_cast<int>(rng.Below(3));
    TableProblem problem = RandomTables(states, rng);
    problem.epsilon = -std::log(kEpsilon);
    const Matrix support = SupportOf(problem.plus, problem.minus, kEpsilon);
    if (!SupportsEveryState(support)) continue;
    ++tried;
    const Matrix logits = RandomPolicy(states, kActions, 3, rng).array().log() - 1e4 * (1 - support.array());
    EXPECT_TRUE(problem.Admits(DbrConfig::DYNAMIC_MIN, logits));
  }
}

TEST(DynamicConstraint, MinAdmitsBetaPlusAlthoughTheSetDoesNot) {
  Rng rng(4);
  const TableProblem problem = RandomTables(5, rng);
  EXPECT_TRUE(problem.Admits(DbrConfig::DYNAMIC_MIN, problem.plus.array().log().matrix()));
  EXPECT_EQ(SupportOf(problem.plus, problem.minus, kEpsilon).minCoeff(), 0);
}

// Returns the mean over states of the probability of actions outside the support.
double MassOutside(const Matrix& policy, const Matrix& support) {
  return (policy.array() * (1 - support.array())).sum() / static_cast<double>(policy.cols());
}

// Returns the greatest p with p log(p/b) + (1-p) log((1-p)/(1-b)) <= divergence.
double GreatestShare(double b, double divergence) {
  double low = b, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double p = (low + high) / 2;
    const double kl = p * std::log(p / b) + (1 - p) * std::log((1 - p) / (1 - b));
    (kl <= divergence ? low : high) = p;
  }
  return high;
}

struct Trained {
  Matrix policy;  // [actions x states]
  PolicyLoss<double> loss;
};

// Descends on the logits and ascends on the multiplier, as DBR's update does.
Trained Train(const TableProblem& problem, DbrConfig::Constraint constraint) {
  Vector logits = problem.plus.array().log().reshaped();
  Adam<double> adam(logits.size(), 2e-2);
  Multiplier<double> multiplier(1, 3e-3);
  Trained trained;
  for (int i = 0; i < 3000; ++i) {
    const Categorical<double> policy = SoftmaxOf(logits.reshaped(problem.plus.rows(), problem.plus.cols()));
    Matrix d_logits;
    trained = {policy.probabilities, problem.Loss(constraint, policy, multiplier.value(), &d_logits)};
    adam.Step(d_logits.reshaped(), &logits);
    multiplier.Step(trained.loss.divergence_plus - trained.loss.threshold);
  }
  return trained;
}

// Q pulls the policy out of the set in every state. The constraint must hold it.
TEST(DynamicConstraint, UnderMinTheMassOutsideTheSetStaysWithinItsBound) {
  Rng rng(5);
  for (int i = 0; i < 20; ++i) {
    TableProblem problem = RandomTables(4 + static_cast<int>(rng.Below(3)), rng);
    const Matrix support = SupportOf(problem.plus, problem.minus, kEpsilon);
    problem.q = Matrix::Ones(support.rows(), support.cols()) - support;
    const Trained trained = Train(problem, DbrConfig::DYNAMIC_MIN);
    const double of_beta_plus = MassOutside(problem.plus, support),
                 of_pi = MassOutside(trained.policy, support);
    EXPECT_NEAR(trained.loss.divergence_plus, trained.loss.threshold, 1e-3);
    EXPECT_GT(of_pi, of_beta_plus);
    EXPECT_LE(of_pi, GreatestShare(of_beta_plus, problem.epsilon + 1e-3));
  }
}

// beta+ prefers the first action and beta- the second. The third is rare under both, but rarer under beta-.
// The order differs from state to state. Q prefers the third, which Pi_eps leaves out, because beta+ is below
// eps there.
TEST(DynamicConstraint, UnderMaxAllMassMayLeaveTheSetAndUnderMinLittleDoes) {
  constexpr int kStates = 5;
  TableProblem problem{.plus = Matrix(kActions, kStates),
                       .minus = Matrix(kActions, kStates),
                       .q = Matrix::Zero(kActions, kStates)};
  Matrix third = Matrix::Zero(kActions, kStates);
  for (int s = 0; s < kStates; ++s) {
    const auto put = [&](int which, double plus, double minus) {
      problem.plus((s + which) % kActions, s) = plus;
      problem.minus((s + which) % kActions, s) = minus;
    };
    put(0, 0.96, 0.19);
    put(1, 0.03, 0.809);
    put(2, 0.01, 0.001);
    third((s + 2) % kActions, s) = 1;
  }
  problem.q = third;
  const Matrix support = SupportOf(problem.plus, problem.minus, kEpsilon);
  EXPECT_EQ(support.sum(), kStates);
  const Trained min = Train(problem, DbrConfig::DYNAMIC_MIN), max = Train(problem, DbrConfig::DYNAMIC_MAX);
  EXPECT_NEAR(min.loss.divergence_plus, problem.epsilon, 1e-3);
  EXPECT_NEAR(min.policy.cwiseProduct(third).sum() / kStates, GreatestShare(0.01, problem.epsilon), 2e-3);
  EXPECT_LT(MassOutside(min.policy, support), 0.1);
  EXPECT_GT(MassOutside(max.policy, support), 0.95);
  EXPECT_LE(max.loss.divergence_plus, max.loss.threshold) << "the constraint as printed is kept all the same";
}

// Networks without hidden layers on one-hot states, so that their weights are the tables.
class SupportActing : public testing::Test {
 protected:
  static std::vector<float> TableOf(const Matrix& outputs) {
    std::vector<float> parameters(outputs.reshaped().begin(),
                                  outputs.reshaped().end());                             // [actions x states]
    parameters.resize(parameters.size() + static_cast<std::size_t>(outputs.rows()), 0);  // no bias
    return parameters;
  }
  // Returns the actions that SUPPORT chooses in each state [1 x states].
  MatrixX<float> Act(const TableProblem& problem) {
    const int states = static_cast<int>(problem.q.cols());
    PolicySnapshot snapshot;
    snapshot.spec = {.env = "tables",
                     .algorithm = "dbr",
                     .observation_size = states,
                     .actions = {ActionKind::kDiscrete, kActions},
                     .hidden_sizes = {}};
    snapshot.support_epsilon = kEpsilon;
    snapshot.networks = {{kPolicyNetwork, TableOf(problem.q)},
                         {kCritic1, TableOf(problem.q)},
                         {kCritic2, TableOf(problem.q)},
                         {kBetaPlus, TableOf(problem.plus.array().log().matrix())},
                         {kBetaMinus, TableOf(problem.minus.array().log().matrix())}};
    const auto policy = PolicyNetworks::Create(snapshot);
    EXPECT_TRUE(policy.ok()) << policy.status();
    MatrixX<float> actions(1, states);
    Rng rng(1);
    EXPECT_TRUE(runner_
                    .Act(**policy, SUPPORT, MatrixX<float>::Identity(states, states),
                         MatrixX<float>::Ones(kActions, states), rng, actions)
                    .ok());
    return actions;
  }
  // Returns 1 for every action that some Q makes SUPPORT choose. Each Q prefers one action, and the others
  // tie.
  Matrix Chosen(TableProblem problem) {
    Matrix chosen = Matrix::Zero(problem.q.rows(), problem.q.cols());
    for (int liked = 0; liked < kActions; ++liked) {
      problem.q.setZero();
      problem.q.row(liked).setOnes();
      const MatrixX<float> actions = Act(problem);
      for (int s = 0; s < actions.cols(); ++s) chosen(static_cast<Eigen::Index>(actions(0, s)), s) = 1;
    }
    return chosen;
  }

  PolicyRunner runner_;
};

TEST_F(SupportActing, ChoosesFromExactlyThePapersSet) {
  Rng rng(6);
  int left_out = 0;
  for (int i = 0; i < 100; ++i) {
    const TableProblem problem = RandomTables(4 + static_cast<int>(rng.Below(3)), rng);
    const Matrix support = SupportOf(problem.plus, problem.minus, kEpsilon), chosen = Chosen(problem);
    for (int s = 0; s < support.cols(); ++s) {
      if (support.col(s).sum() == 0) continue;  // the next test has these states
      EXPECT_EQ(Vector(chosen.col(s)), Vector(support.col(s)));
      left_out += static_cast<int>(kActions - support.col(s).sum());
    }
  }
  EXPECT_GT(left_out, 300);
}

TEST_F(SupportActing, WhereTheSetHasNoActionTheGreatestRatioIsTaken) {
  TableProblem problem{
      .plus = Matrix(kActions, 1), .minus = Matrix(kActions, 1), .q = Matrix::Zero(kActions, 1)};
  problem.plus << 0.48, 0.48, 0.04;
  problem.minus << 0.49, 0.50, 0.01;
  EXPECT_EQ(SupportOf(problem.plus, problem.minus, kEpsilon).sum(), 0);
  Matrix only_third = Matrix::Zero(kActions, 1);
  only_third(2, 0) = 1;
  EXPECT_EQ(Chosen(problem), only_third);
}

TEST_F(SupportActing, WhereTheBehavioursAgreeEveryLikelyEnoughActionIsInTheSet) {
  TableProblem problem{
      .plus = Matrix(kActions, 1), .minus = Matrix(kActions, 1), .q = Matrix::Zero(kActions, 1)};
  problem.plus << 0.60, 0.36, 0.04;
  problem.minus = problem.plus;
  EXPECT_EQ(Chosen(problem), SupportOf(problem.plus, problem.minus, kEpsilon));
}

}  // namespace
}  // namespace dbr::tabular
