// Tests every algorithm of the registry, and some variants, on small problems with answers in closed form.
#include "tests/learner/algorithms/known_problems.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "learner/algorithms/registry.h"

namespace dbr {
namespace {

// Discrete actions. Action 1 goes to the other state with reward 0. Action 0 stays, with reward 0.2 in state
// 0 and 1 in state 1. With gamma = 0.5: Q*(1, stay) = 1 / (1 - 0.5) = 2, Q*(0, go) = 0.5 * 2 = 1, Q*(0, stay)
// = 0.2 + 0.5 * 1 = 0.7, Q*(1, go) = 0.5 * 1 = 0.5. The best action in state 0 is the one with the smaller
// immediate reward.
constexpr int kStay = 0, kGo = 1;
const KnownProblem kTwoStates{.actions = {ActionKind::kDiscrete, 2},
                              .states = 2,
                              .discount = 0.5,
                              .outcome = [](int state, double action) -> KnownProblem::Outcome {
                                return action == kGo ? KnownProblem::Outcome{0, 1 - state}
                                                     : KnownProblem::Outcome{state == 0 ? 0.2 : 1, state};
                              }};

// The same with a third action, "feast". In state 1 it has reward 1.5 and stays; in state 0 it is illegal. So
// V*(1) = 1.5 / (1 - 0.5) = 3, Q*(1, stay) = 1 + 0.5 * 3 = 2.5, Q*(0, go) = 1.5, Q*(0, stay) = 0.2 + 0.5 *
// 1.5 = 0.95, Q*(1, go) = 0.75. A target without the mask would use Q of a feast in state 0.
constexpr int kFeast = 2;
const KnownProblem kIllegalFeast{
    .actions = {ActionKind::kDiscrete, 3},
    .states = 2,
    .discount = 0.5,
    .outcome = [](int state, double action) -> KnownProblem::Outcome {
      return action == kFeast ? KnownProblem::Outcome{1.5, state} : kTwoStates.outcome(state, action);
    },
    .legal = [](int state, int action) { return action != kFeast || state == 1; }};

// Continuous actions a in [-1, 1]. The states alternate for every action. The reward is 1 - (a - 0.5)^2 in
// state 0 and -(a + 0.3)^2 in state 1. So a* = (0.5, -0.3), V*(0) = 1 + 0.5 V*(1), V*(1) = 0.5 V*(0): V* =
// (4/3, 2/3), and Q*(s, a) = V*(s) - (a - a*_s)^2.
constexpr double kBest[] = {0.5, -0.3}, kBestValue[] = {4.0 / 3, 2.0 / 3};
const KnownProblem kTwoTargets{.actions = {ActionKind::kContinuous, 1},
                               .states = 2,
                               .discount = 0.5,
                               .outcome = [](int state, double action) -> KnownProblem::Outcome {
                                 const double miss = action - kBest[state];
                                 return {(state == 0 ? 1 : 0) - miss * miss, 1 - state};
                               }};

KnownProblem WithConstantRewards(KnownProblem problem) {
  problem.outcome = [](int state, double) -> KnownProblem::Outcome { return {1, 1 - state}; };
  return problem;
}

// An algorithm with its defaults, or with one of its variants.
struct Solver {
  AlgorithmId id;
  std::string variant;  // a name in kVariants; empty: the defaults
};

struct Variant {
  const char* name;
  const char* algorithm;
  void (*set)(AlgorithmConfig* config);
};

constexpr Variant kVariants[] = {
    {"Online", "dbr",
     [](AlgorithmConfig* config) {
       DbrConfig* dbr = config->mutable_dbr();
       dbr->set_first_temperature(0.02);
       dbr->set_repel_negative(true);
       dbr->set_max_repulsion(6);
     }},
    {"FourCritics", "dbr", [](AlgorithmConfig* config) { config->set_critics(4); }},
    {"FourCritics", "sac", [](AlgorithmConfig* config) { config->set_critics(4); }},
    {"Batch", "dbr",
     [](AlgorithmConfig* config) { config->mutable_dbr()->set_behavior_data(DbrConfig::BATCH); }},
};

std::vector<Solver> SolversAmong(const std::vector<AlgorithmId>& ids) {
  std::vector<Solver> solvers;
  for (const AlgorithmId& id : ids) {
    solvers.push_back({id, ""});
    for (const Variant& variant : kVariants) {
      if (id.name == variant.algorithm) solvers.push_back({id, variant.name});
    }
  }
  return solvers;
}

std::string NameOf(const testing::TestParamInfo<Solver>& info) {
  const AlgorithmId& id = info.param.id;
  return id.name + (id.actions == ActionKind::kDiscrete ? "Discrete" : "Continuous") + info.param.variant;
}

class KnownProblems : public testing::TestWithParam<Solver> {
 protected:
  static bool discrete() { return GetParam().id.actions == ActionKind::kDiscrete; }
  static AlgorithmConfig Config() {
    AlgorithmConfig config = ProblemSolvingConfig(GetParam().id);
    for (const Variant& variant : kVariants) {
      if (GetParam().variant == variant.name && GetParam().id.name == variant.algorithm) variant.set(&config);
    }
    return config;
  }
};

constexpr int kUpdates = 500;

// Discrete actions: expectations are exact, and an entropy weight of 0.02 moves Q by at most 0.02 log 3 gamma
// / (1 - gamma) = 0.022. Continuous actions: V' is moved by the weights of SAC and BRAC (0.02; a variance of
// 0.01), by TD3's noise on the target (a variance of 0.04), by AWAC's spread (temperature / 2 = 0.025) and by
// the greatest of ten draws in DBR and BEAR. Q moves by gamma / (1 - gamma) = 1 times as much.
constexpr double kDiscreteTolerance = 0.05, kContinuousTolerance = 0.1, kActionTolerance = 0.1;

TEST_P(KnownProblems, TheTwoStatesHaveTheirClosedFormAnswer) {
  if (discrete()) {
    TrainedOnProblem trained(kTwoStates, Config(), kUpdates);
    EXPECT_EQ(trained.Act(MODE)(0, 0), kGo);
    EXPECT_EQ(trained.Act(MODE)(0, 1), kStay);
    EXPECT_NEAR(trained.Value(0, kStay), 0.7, kDiscreteTolerance);
    EXPECT_NEAR(trained.Value(0, kGo), 1, kDiscreteTolerance);
    EXPECT_NEAR(trained.Value(1, kStay), 2, kDiscreteTolerance);
    EXPECT_NEAR(trained.Value(1, kGo), 0.5, kDiscreteTolerance);
  } else {
    TrainedOnProblem trained(kTwoTargets, Config(), kUpdates);
    for (const int state : {0, 1}) {
      EXPECT_NEAR(trained.Act(MODE)(0, state), kBest[state], kActionTolerance) << "in state " << state;
      for (const double miss : {0.0, 0.4, -0.7}) {
        EXPECT_NEAR(trained.Value(state, kBest[state] + miss), kBestValue[state] - miss * miss,
                    kContinuousTolerance)
            << "in state " << state << ", " << miss << " beside the best action";
      }
    }
  }
}

// Every value is 1 / (1 - 0.5) = 2, and no action is better than another one.
TEST_P(KnownProblems, ConstantRewardsGiveTheirDiscountedSum) {
  TrainedOnProblem trained(WithConstantRewards(discrete() ? kTwoStates : kTwoTargets), Config(), kUpdates);
  for (const int state : {0, 1}) {
    for (const int action : {0, 1}) EXPECT_NEAR(trained.Value(state, action), 2, kDiscreteTolerance);
  }
  for (const float advantage : trained.algorithm().advantages()) {
    EXPECT_LT(std::abs(advantage), kDiscreteTolerance);
  }
}

TEST_P(KnownProblems, BatchesOfOneLearnTheSameConstant) {
  AlgorithmConfig config = Config();
  config.set_batch_size(1);
  TrainedOnProblem trained(WithConstantRewards(discrete() ? kTwoStates : kTwoTargets), config, kUpdates);
  for (const int state : {0, 1}) EXPECT_NEAR(trained.Value(state, 0), 2, 0.25);
  EXPECT_EQ(trained.algorithm().advantages().size(), 1u);
}

std::vector<AlgorithmId> AlgorithmsOver(ActionKind kind) {
  std::vector<AlgorithmId> chosen;
  for (const AlgorithmId& id : Algorithms()) {
    if (id.actions == kind) chosen.push_back(id);
  }
  return chosen;
}

using MaskedProblems = KnownProblems;

TEST_P(MaskedProblems, AnIllegalActionIsNeitherTakenNorCounted) {
  TrainedOnProblem trained(kIllegalFeast, Config(), kUpdates);
  EXPECT_NEAR(trained.Value(1, kFeast), 3, kDiscreteTolerance);
  EXPECT_NEAR(trained.Value(1, kGo), 0.75, kDiscreteTolerance);
  EXPECT_NEAR(trained.Value(0, kGo), 1.5, kDiscreteTolerance);
  EXPECT_NEAR(trained.Value(0, kStay), 0.95, kDiscreteTolerance);
  EXPECT_EQ(trained.Act(MODE)(0, 1), kFeast);
  for (const ActingMode mode : {SAMPLE, MODE, GREEDY_Q, SUPPORT}) {
    if (mode == SUPPORT && !trained.Has(kBetaMinus)) continue;
    for (int i = 0; i < 100; ++i) EXPECT_NE(trained.Act(mode)(0, 0), kFeast);
  }
}

INSTANTIATE_TEST_SUITE_P(Registry, MaskedProblems,
                         testing::ValuesIn(SolversAmong(AlgorithmsOver(ActionKind::kDiscrete))), NameOf);
INSTANTIATE_TEST_SUITE_P(Registry, KnownProblems, testing::ValuesIn(SolversAmong(Algorithms())), NameOf);

// One state and episodes of one step, so that the data of DBR's two behaviour policies is known.
class Bandit : public testing::TestWithParam<DbrConfig::Constraint> {
 protected:
  static AlgorithmConfig Config(ActionKind actions) {
    AlgorithmConfig config =
        ProblemSolvingConfig({.name = "dbr", .actions = actions, .source = "", .variants = ""});
    config.mutable_dbr()->set_constraint(GetParam());
    return config;
  }
};

// Actions 0 and 1 have reward 1, the others 0. While pi takes any of the others, V is between 0 and 1. Then
// D+ holds the first two, and D- the others.
TEST_P(Bandit, BetaPlusTakesTheGoodActionsAndBetaMinusTheBad) {
  const KnownProblem problem{.actions = {ActionKind::kDiscrete, 4},
                             .states = 1,
                             .discount = 0,
                             .outcome = [](int, double action) -> KnownProblem::Outcome {
                               return {action < 2 ? 1.0 : 0.0, 0};
                             }};
  TrainedOnProblem trained(problem, Config(ActionKind::kDiscrete), kUpdates);
  double distance = 0, plus_good = 0, minus_bad = 0;
  for (const int action : {0, 1, 2, 3}) {
    const double plus = trained.Probability(kBetaPlus, 0, action);
    const double minus = trained.Probability(kBetaMinus, 0, action);
    distance += std::abs(plus - minus) / 2;
    (action < 2 ? plus_good : minus_bad) += action < 2 ? plus : minus;
  }
  EXPECT_GT(plus_good, 0.98);
  EXPECT_GT(minus_bad, 0.95);
  EXPECT_GT(distance, 0.9);
}

// The reward is the action a, so D+ is above V and D- below it. pi climbs to the greatest action, and V with
// it. D+ is then the few rows near there, and D- nearly all the data, whose mean is 0.
TEST_P(Bandit, TheMeansOfBetaPlusAndBetaMinusLieOnEitherSideOfTheGoodAndTheBad) {
  const KnownProblem problem{.actions = {ActionKind::kContinuous, 1},
                             .states = 1,
                             .discount = 0,
                             .outcome = [](int, double action) -> KnownProblem::Outcome {
                               return {action, 0};
                             }};
  TrainedOnProblem trained(problem, Config(ActionKind::kContinuous), kUpdates);
  EXPECT_GT(trained.Act(MODE)(0, 0), 0.9);
  EXPECT_GT(trained.Mean(kBetaPlus, 0), 0.9);
  EXPECT_NEAR(trained.Mean(kBetaMinus, 0), 0, 0.25);
}

INSTANTIATE_TEST_SUITE_P(Constraints, Bandit,
                         testing::Values(DbrConfig::DYNAMIC_MAX, DbrConfig::DYNAMIC_MIN, DbrConfig::FIXED),
                         [](const auto& info) { return DbrConfig::Constraint_Name(info.param); });

}  // namespace
}  // namespace dbr
