// Problems with known answers for algorithms over discrete actions.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "nn/policy.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {

// Trains on batches that always hold all transitions, partitioned by the newest advantages. A test sets
// `config_` first; the default is DBR.
class TinyProblem : public testing::Test {
 protected:
  struct Step {
    int state, action;
    float reward, discount;
    int next_state;
  };

  TinyProblem() : config_(SmallSpec().config) {
    config_.set_learning_rate(3e-3);
    config_.set_target_tau(0.05);
  }

  // One state with three actions, each four times. Action 1 has reward 1, the others 0.
  static std::vector<Step> Bandit() {
    std::vector<Step> steps;
    for (int copy = 0; copy < 4; ++copy) {
      for (int a = 0; a < 3; ++a) steps.push_back({0, a, a == 1 ? 1.0f : 0.0f, 0, 0});
    }
    return steps;
  }

  // State 0: action 0 goes to state 1 with reward 0, and action 1 ends with 0.3. State 1: action 0 ends with
  // 1, and action 1 with -1. So Q*(1, .) = (1, -1) and Q*(0, .) = (0.9, 0.3) for a discount of 0.9.
  static std::vector<Step> Chain() {
    return {{0, 0, 0, 0.9f, 1}, {0, 1, 0.3f, 0, 0}, {1, 0, 1, 0, 0}, {1, 1, -1, 0, 0}};
  }

  // Trains, and stores the policy's view of each state in view_. Actions from `legal` on are illegal in every
  // state. 0 means that none is.
  void Train(const std::vector<Step>& steps, int states, int actions, int updates, int legal = 0) {
    masks_ = MatrixX<float>::Ones(actions, states);
    if (legal > 0) masks_.bottomRows(actions - legal).setZero();
    AlgorithmSpec spec = SmallSpec();
    spec.observation_size = states;
    spec.actions.size = actions;
    spec.hidden_sizes = {32, 32};
    spec.config = config_;
    auto made = MakeAlgorithm(spec);
    ASSERT_TRUE(made.ok()) << made.status();
    algorithm_ = *std::move(made);
    const Batch all = Fill(steps, [](std::size_t) { return true; });
    Batch plus, minus;
    for (int i = 0; i < updates; ++i) {
      ASSERT_TRUE(algorithm_->Update({all, plus, minus}).ok());
      plus = Fill(steps, [&](std::size_t k) { return algorithm_->advantages()[k] >= 0; });
      minus = Fill(steps, [&](std::size_t k) { return algorithm_->advantages()[k] <= 0; });
    }
    PolicySnapshot snapshot;
    algorithm_->ExportPolicy(&snapshot);
    const auto policy = PolicyNetworks::Create(snapshot);
    ASSERT_TRUE(policy.ok());
    view_ = runner_.View(**policy, MatrixX<float>::Identity(states, states), masks_);
  }

  // Returns the newest update's metric of that name.
  double Metric(const std::string& name) const {
    for (const UpdateMetric& metric : algorithm_->metrics()) {
      if (metric.name == name) return metric.value;
    }
    ADD_FAILURE() << "no metric " << name;
    return 0;
  }

  AlgorithmConfig config_;
  std::unique_ptr<Algorithm> algorithm_;
  PolicyView view_;

 private:
  template <class Predicate>
  Batch Fill(const std::vector<Step>& steps, const Predicate& wanted) const {
    std::vector<const Step*> chosen;
    for (std::size_t k = 0; k < steps.size(); ++k) {
      if (wanted(k)) chosen.push_back(&steps[k]);
    }
    Batch batch;
    batch.Resize({static_cast<int>(masks_.cols()), 1, static_cast<int>(masks_.rows())},
                 static_cast<Eigen::Index>(chosen.size()), false);
    batch.observations.setZero();
    batch.next_observations.setZero();
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const auto j = static_cast<Eigen::Index>(k);
      batch.observations(chosen[k]->state, j) = 1;
      batch.next_observations(chosen[k]->next_state, j) = 1;
      batch.masks.col(j) = masks_.col(chosen[k]->state);
      batch.next_masks.col(j) = masks_.col(chosen[k]->next_state);
      batch.actions(0, j) = static_cast<float>(chosen[k]->action);
      batch.rewards[j] = chosen[k]->reward;
      batch.discounts[j] = chosen[k]->discount;
    }
    return batch;
  }

  MatrixX<float> masks_;  // [actions x states]
  PolicyRunner runner_;
};

}  // namespace dbr
