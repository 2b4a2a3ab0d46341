#include "tests/learner/algorithms/known_problems.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "learner/algorithms/registry.h"
#include "nn/categorical.h"
#include "proto/config/config_file.h"
#include "tests/learner/runtime/tiny_replay.h"

namespace dbr {
namespace {

constexpr int kRows = 256;

bool IsLegal(const KnownProblem& problem, int state, int action) {
  return problem.legal == nullptr || problem.legal(state, action);
}

double RandomAction(const KnownProblem& problem, int state, Rng& rng) {
  if (!problem.actions.discrete()) return 2 * rng.Uniform() - 1;
  for (;;) {
    const int action = static_cast<int>(rng.Below(static_cast<std::uint32_t>(problem.actions.size)));
    if (IsLegal(problem, state, action)) return action;
  }
}

Batch DataOf(const KnownProblem& problem, const OptionalColumns& columns, const MatrixX<float>& masks,
             Rng& rng) {
  Batch batch;
  batch.Resize(
      TransitionLayout::Of({.observation_size = problem.states, .actions = problem.actions}, columns), kRows,
      /*with_keys=*/false);
  batch.observations.setZero();
  batch.next_observations.setZero();
  batch.returns.setConstant(-1);  // below the value of every state
  for (float& action : batch.next_actions.reshaped()) action = static_cast<float>(2 * rng.Uniform() - 1);
  batch.discounts.setConstant(static_cast<float>(problem.discount));
  for (Eigen::Index j = 0; j < kRows; ++j) {
    const auto state = static_cast<int>(rng.Below(static_cast<std::uint32_t>(problem.states)));
    const double action = RandomAction(problem, state, rng);
    const KnownProblem::Outcome outcome = problem.outcome(state, action);
    batch.observations(state, j) = 1;
    batch.actions(0, j) = static_cast<float>(action);
    batch.rewards[j] = static_cast<float>(outcome.reward);
    batch.next_observations(outcome.next_state, j) = 1;
    batch.masks.col(j) = masks.col(state);
    batch.next_masks.col(j) = masks.col(outcome.next_state);
  }
  return batch;
}

}  // namespace

AlgorithmConfig ProblemSolvingConfig(const AlgorithmId& id) {
  AlgorithmConfig config;
  config.set_batch_size(32);
  config.set_learning_rate(5e-3);
  config.set_target_tau(0.1);
  config.set_threads(1);
  if (id.name == "dbr") {
    config.mutable_dbr();
  } else if (id.name == "sac") {
    config.mutable_sac()->set_first_temperature(0.02);
    config.mutable_sac()->set_temperature_learning_rate(0);
  } else if (id.name == "bear") {
    BearConfig* bear = config.mutable_bear();
    bear->set_divergence(id.actions == ActionKind::kDiscrete ? DbrConfig::KL : DbrConfig::MMD_LAPLACIAN);
    bear->set_epsilon(1.1);  // discrete: KL(one action || uniform over three) = log 3
    bear->set_first_multiplier(0.05);
    bear->set_warm_start_updates(0);
    bear->add_vae_hidden_sizes(32);
    bear->add_vae_hidden_sizes(32);
  } else if (id.name == "brac") {
    config.mutable_brac()->set_first_multiplier(0.02);
  } else if (id.name == "td3") {
    config.mutable_td3();
  } else if (id.name == "awac") {
    config.mutable_awac()->set_temperature(0.05);
    config.mutable_awac()->set_value_samples(4);
  } else if (id.name == "td3_bc") {
    config.mutable_td3_bc()->set_q_weight(50);
  } else if (id.name == "rebrac") {
    config.mutable_rebrac();
  } else if (id.name == "iql") {
    config.mutable_iql()->set_expectile(0.97);
    config.mutable_iql()->set_temperature(0.05);
  } else if (id.name == "cal_ql") {
    config.mutable_cal_ql()->set_first_temperature(0.02);
    config.mutable_cal_ql()->set_temperature_learning_rate(0);
    config.mutable_cal_ql()->set_conservative_weight(0.01);
  } else if (id.name == "ddqn") {
    config.mutable_ddqn();
  } else if (id.name == "discrete_sac") {
    config.mutable_discrete_sac()->set_first_temperature(0.02);
    config.mutable_discrete_sac()->set_temperature_learning_rate(0);
  } else {
    ADD_FAILURE() << "give the new algorithm '" << id.name << "' its config here";
  }
  return config;
}

TrainedOnProblem::TrainedOnProblem(const KnownProblem& problem, const AlgorithmConfig& config, int updates)
    : problem_(problem) {
  AlgorithmSpec spec{.env = "known problem",
                     .observation_size = problem.states,
                     .actions = problem.actions,
                     .hidden_sizes = {32, 32},
                     .config = config,
                     .seed = 3};
  auto algorithm = MakeAlgorithm(spec);
  EXPECT_TRUE(algorithm.ok()) << algorithm.status();
  algorithm_ = *std::move(algorithm);
  TinyReplay replay(DataOf(problem, OptionalColumnsOf(config), Masks(), rng_), 11);
  const absl::Status status = replay.Train(algorithm_.get(), updates);
  EXPECT_TRUE(status.ok()) << status;
  PolicySnapshot snapshot;
  algorithm_->ExportPolicy(&snapshot);
  policy_ = PolicyNetworks::Create(std::move(snapshot)).value();
}

MatrixX<float> TrainedOnProblem::Masks() const {
  MatrixX<float> masks(problem_.actions.mask_width(), problem_.states);
  for (int s = 0; s < masks.cols(); ++s) {
    for (int a = 0; a < masks.rows(); ++a) masks(a, s) = IsLegal(problem_, s, a) ? 1 : 0;
  }
  return masks;
}

MatrixX<float> TrainedOnProblem::Act(ActingMode mode) {
  MatrixX<float> actions(1, problem_.states);
  const absl::Status status = runner_.Act(
      *policy_, mode, MatrixX<float>::Identity(problem_.states, problem_.states), Masks(), rng_, actions);
  EXPECT_TRUE(status.ok()) << status;
  return actions;
}

MatrixX<float> TrainedOnProblem::Output(const std::string& network, const MatrixX<float>& input) const {
  MlpActivations<float> activations;
  return policy_->Run(network, input, &activations);
}

double TrainedOnProblem::Value(int state, double action) {
  const bool discrete = problem_.actions.discrete();
  MatrixX<float> input = MatrixX<float>::Zero(policy_->ShapeOf(kCritic1).input_size(), 1);
  input(state, 0) = 1;
  if (!discrete) input(problem_.states, 0) = static_cast<float>(action);
  const Eigen::Index row = discrete ? static_cast<Eigen::Index>(action) : 0;
  return std::min(Output(kCritic1, input)(row, 0), Output(kCritic2, input)(row, 0));
}

double TrainedOnProblem::Probability(const std::string& network, int state, int action) {
  const MatrixX<float> states = MatrixX<float>::Identity(problem_.states, problem_.states);
  Categorical<float> distribution;
  MaskedSoftmax<float>(Output(network, states), Masks(), &distribution);
  return distribution.probabilities(action, state);
}

double TrainedOnProblem::Mean(const std::string& network, int state) {
  const MatrixX<float> states = MatrixX<float>::Identity(problem_.states, problem_.states);
  return std::tanh(Output(network, states)(0, state));
}

}  // namespace dbr
