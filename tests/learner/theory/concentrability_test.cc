// Tests the theorem of the paper's section "From ARM and BEAR to DBR" on random small MDPs:
//   C(Pi_eps) <= C(beta+) * (1 + gamma / ((1 - gamma) f) * (1 - eps)).
//
// What can be proved: write mu for the marginal that C divides by, and f for the least mu(s) among the states
// that Pi_eps reaches. A policy of Pi_eps acts only where beta+ >= eps. So in each state it can be coupled to
// beta+ with the same action at least eps of the time. After k steps the two have separated with probability
// at most 1 - eps^k. Hence c(k) of Pi_eps is at most c(k) of beta+ plus (1 - eps^k) / f. With the weights of
// C this gives the "proven" bound, for every mu:
//   C(Pi_eps) <= C(beta+) + (1 - eps) / f * (1 - gamma^2 eps) / (1 - gamma eps)^2
// C(beta+) >= 1, because mu sums to 1 and so does the weighted sum of p_k. So the printed form follows where
// gamma / (1 - gamma) >= (1 - gamma^2 eps) / (1 - gamma eps)^2. For eps = 0.05 that is gamma >= 0.51.
//
// Where the printed theorem goes further than the proof:
//   1. The printed f is the greater of the least mu_{beta+}(s) and the least mu_{beta-}(s). The proof divides
//      by mu_{beta+}, so only the former can be f.
//   2. For small gamma the printed form can fail. C has no weight on steps before the first, so C(Pi_eps)
//      does not shrink to C(beta+) as gamma goes to 0. But the printed factor shrinks to 1.
//   3. The total variation in the proof, gamma / (1 - gamma) * (1 - eps), is that of the usual discounted
//      marginal, not of the proof's own formula. And the ratio of the Cs is not the supremum of the ratio of
//      the marginals, because C has the maximum over states inside its sum.
// The tests expect the proven bound everywhere, and the printed one with the proof's f for gamma >= 0.51.
// They show the printed one fail with the printed f, and for a small gamma.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/learner/theory/tabular_mdp.h"

namespace dbr::tabular {
namespace {

// The two sides of the theorem in one MDP.
struct Bounds {
  double c_set = 0;      // C(Pi_eps)
  double c_plus = 0;     // C(beta+)
  double f_plus = 0;     // the least mu_{beta+}(s)
  double f_printed = 0;  // the greater of f_plus and the least mu_{beta-}(s)
  double discount = 0, epsilon = 0;

  double Proven() const {
    const double shared = 1 - discount * epsilon;
    return c_plus + (1 - epsilon) / f_plus * (1 - discount * discount * epsilon) / (shared * shared);
  }
  // Whether the printed form follows from the proven one. It uses C(beta+) >= 1.
  bool PrintedFollows() const {
    const double shared = 1 - discount * epsilon;
    return discount / (1 - discount) >= (1 - discount * discount * epsilon) / (shared * shared);
  }
  double Printed(double f) const { return c_plus * (1 + discount / ((1 - discount) * f) * (1 - epsilon)); }
  // Whether the bound holds, except for rounding and the rest of the series.
  bool Within(double bound) const { return c_set <= bound * (1 + 1e-6); }
};

struct Problem {
  Mdp mdp;
  Matrix plus, minus;
};

Bounds BoundsOf(const Problem& problem, double epsilon, double discount, Marginal marginal) {
  const Matrix support = SupportOf(problem.plus, problem.minus, epsilon);
  const Vector mu = StateMarginal(problem.mdp, problem.plus, discount, marginal);
  const Vector mu_minus = StateMarginal(problem.mdp, problem.minus, discount, marginal);
  const double f_plus = LeastReached(problem.mdp, support, mu);
  return {.c_set = Concentrability(problem.mdp, support, mu, discount),
          .c_plus = ConcentrabilityOf(problem.mdp, problem.plus, mu, discount),
          .f_plus = f_plus,
          .f_printed = std::max(f_plus, LeastReached(problem.mdp, support, mu_minus)),
          .discount = discount,
          .epsilon = epsilon};
}

// Draws 4 to 6 states, 3 actions, and behaviour policies for which Pi_eps has an action in every state. (Else
// Pi_eps is empty, and the theorem says nothing.)
Problem RandomProblem(double epsilon, Rng& rng) {
  for (;;) {
    const int states = 4 + static_cast<int>(rng.Below(3)), actions = 3;
    const double sharpness = 1 + 2 * rng.Uniform();
    Problem problem{.mdp = RandomMdp(states, actions, 2, rng),
                    .plus = RandomPolicy(states, actions, sharpness, rng),
                    .minus = RandomPolicy(states, actions, sharpness, rng)};
    if (SupportsEveryState(SupportOf(problem.plus, problem.minus, epsilon))) return problem;
  }
}

constexpr int kProblems = 50;  // for each eps and each reading of mu

// Returns both sides in random problems, for several eps and both readings of mu.
std::vector<Bounds> RandomBounds(double discount) {
  Rng rng(17);
  std::vector<Bounds> all;
  for (const double epsilon : {0.01, 0.05, 0.2}) {
    for (const Marginal marginal : {Marginal::kDiscounted, Marginal::kProof}) {
      for (int i = 0; i < kProblems; ++i) {
        all.push_back(BoundsOf(RandomProblem(epsilon, rng), epsilon, discount, marginal));
      }
    }
  }
  return all;
}

TEST(GreatestReachTest, IsThatOfTheBestSequenceOfDeterministicPolicies) {
  Rng rng(3);
  const Problem problem = RandomProblem(0.05, rng);
  const Mdp& mdp = problem.mdp;
  const Matrix support = SupportOf(problem.plus, problem.minus, 0.05);
  // Makes all deterministic policies of the set.
  std::vector<Matrix> policies = {Matrix::Zero(mdp.actions, mdp.states)};
  for (int s = 0; s < mdp.states; ++s) {
    std::vector<Matrix> longer;
    for (const Matrix& policy : policies) {
      for (int a = 0; a < mdp.actions; ++a) {
        if (support(a, s) <= 0) continue;
        longer.push_back(policy);
        longer.back()(a, s) = 1;
      }
    }
    policies = longer;
  }
  ASSERT_GT(policies.size(), 1u);
  Vector once = Vector::Zero(mdp.states), twice = once;
  for (const Matrix& first : policies) {
    const Vector after = Transitions(mdp, first) * mdp.start;
    once = once.cwiseMax(after);
    for (const Matrix& second : policies) twice = twice.cwiseMax(Transitions(mdp, second) * after);
  }
  GreatestReach reach(mdp, support);
  EXPECT_TRUE(reach.Next().isApprox(once, 1e-12));
  EXPECT_TRUE(reach.Next().isApprox(twice, 1e-12));
}

TEST(MarginalTest, BothReadingsAreTheirSeries) {
  Rng rng(4);
  const Problem problem = RandomProblem(0.05, rng);
  const double discount = 0.8;
  Vector visits = Vector::Zero(problem.mdp.states), proof = visits, p = problem.mdp.start;
  const Matrix transitions = Transitions(problem.mdp, problem.plus);
  double power = 1;
  for (int k = 0; k < 400; ++k) {
    visits += (1 - discount) * power * p;
    p = (transitions * p).eval();
    proof += (1 - discount) * (1 - discount) * (k + 1) * power * p;
    power *= discount;
  }
  EXPECT_TRUE(
      StateMarginal(problem.mdp, problem.plus, discount, Marginal::kDiscounted).isApprox(visits, 1e-9));
  EXPECT_TRUE(StateMarginal(problem.mdp, problem.plus, discount, Marginal::kProof).isApprox(proof, 1e-9));
  EXPECT_NEAR(proof.sum(), 1, 1e-9);
}

class Theorem : public testing::TestWithParam<double> {};

TEST_P(Theorem, HoldsInRandomProblemsAsFarAsItCanBeProved) {
  const double discount = GetParam();
  double nearest = 0;
  int problems = 0, printed_form = 0, printed_f = 0, differ = 0;
  for (const Bounds& bounds : RandomBounds(discount)) {
    EXPECT_GE(bounds.c_plus, 1 - 1e-6);
    EXPECT_TRUE(bounds.Within(bounds.Proven())) << bounds.c_set << " is above " << bounds.Proven();
    nearest = std::max(nearest, bounds.c_set / bounds.Proven());
    const bool holds = bounds.Within(bounds.Printed(bounds.f_plus));
    if (bounds.PrintedFollows()) {
      EXPECT_TRUE(holds) << bounds.c_set << " is above " << bounds.Printed(bounds.f_plus);
    }
    ++problems;
    printed_form += holds;
    printed_f += bounds.Within(bounds.Printed(bounds.f_printed));
    differ += bounds.f_printed > bounds.f_plus;
  }
  EXPECT_GT(nearest, 0.6) << "the bound should not be far above what it bounds";
  EXPECT_GT(differ, problems / 5);
  RecordProperty("problems", problems);
  RecordProperty("printed_form_holds_with_f_of_beta_plus", printed_form);
  RecordProperty("printed_form_holds_with_printed_f", printed_f);
  EXPECT_GE(printed_f, discount < 0.5 ? 0.8 * problems : 0.96 * problems);
}

INSTANTIATE_TEST_SUITE_P(Discounts, Theorem, testing::Values(0.1, 0.55, 0.9, 0.99), [](const auto& info) {
  return "Discount" + std::to_string(static_cast<int>(100 * info.param + 0.5)) + "Percent";
});

// In state 0, action 0 stays, and actions 1 and 2 lead to state 1. From there all actions lead back. beta-
// takes action 2, which is not in Pi_eps, and so visits state 1 often, where beta+ seldom is. So the printed
// f is that of beta- and large. Pi_eps can be in state 1 after any step, and beta+ has 0.015 times its
// probability there.
TEST(TheoremTest, APrintedFOfBetaMinusCanFail) {
  Problem problem{.mdp = {.states = 2, .actions = 3, .next = Matrix::Zero(2, 6), .start = Vector::Unit(2, 0)},
                  .plus = Matrix::Constant(3, 2, 1.0 / 3),
                  .minus = Matrix::Constant(3, 2, 1.0 / 3)};
  problem.mdp.next.row(0) << 1, 0, 0, 1, 1, 1;
  problem.mdp.next.row(1) << 0, 1, 1, 0, 0, 0;
  problem.plus.col(0) << 0.985, 0.010, 0.005;
  problem.minus.col(0) << 0.300, 0.005, 0.695;
  for (const Marginal marginal : {Marginal::kDiscounted, Marginal::kProof}) {
    const Bounds bounds = BoundsOf(problem, 0.01, 0.9, marginal);
    EXPECT_GT(bounds.f_printed, 10 * bounds.f_plus);
    EXPECT_GT(bounds.c_set, 2 * bounds.Printed(bounds.f_printed));
    EXPECT_TRUE(bounds.Within(bounds.Printed(bounds.f_plus)));
    EXPECT_TRUE(bounds.Within(bounds.Proven()));
  }
}

// Action a leads to state a. beta+ and the start are uniform. So mu = (1/2, 1/2) and C(beta+) = 1. A policy
// that always goes to the same state gives C(Pi_eps) = 2 for every gamma. The printed bound is 1 + 1.9 gamma
// / (1 - gamma).
TEST(TheoremTest, ThePrintedFormCanFailForASmallDiscount) {
  Problem problem{
      .mdp = {.states = 2, .actions = 2, .next = Matrix::Zero(2, 4), .start = Vector::Constant(2, 0.5)},
      .plus = Matrix::Constant(2, 2, 0.5),
      .minus = Matrix::Constant(2, 2, 0.5)};
  problem.mdp.next << 1, 0, 1, 0, 0, 1, 0, 1;
  for (const Marginal marginal : {Marginal::kDiscounted, Marginal::kProof}) {
    const Bounds small = BoundsOf(problem, 0.05, 0.3, marginal),
                 large = BoundsOf(problem, 0.05, 0.6, marginal);
    EXPECT_NEAR(small.c_set, 2, 1e-6);
    EXPECT_NEAR(small.Printed(small.f_plus), 1 + 1.9 * 0.3 / 0.7, 1e-6);
    EXPECT_FALSE(small.Within(small.Printed(small.f_plus)));
    EXPECT_TRUE(small.Within(small.Proven()));
    EXPECT_NEAR(large.c_set, 2, 1e-6);
    EXPECT_TRUE(large.Within(large.Printed(large.f_plus)));
  }
}

}  // namespace
}  // namespace dbr::tabular
