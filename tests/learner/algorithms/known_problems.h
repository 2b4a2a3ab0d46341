// Small problems with closed-form answers, and the results of algorithms after training on them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "nn/policy.h"

namespace dbr {

// A finite problem over one-hot states. Its data has uniformly random states and legal actions.
struct KnownProblem {
  // The result of an action in a state.
  struct Outcome {
    double reward = 0;
    int next_state = 0;
  };

  ActionSpace actions;  // discrete, or one dimension in [-1, 1]
  int states = 1;
  double discount = 0;
  Outcome (*outcome)(int state, double action) = nullptr;
  bool (*legal)(int state, int action) = nullptr;  // for discrete actions; null: all are legal
};

// Returns the config with which the named algorithm should solve such problems in a few hundred updates.
// Constraints are so loose that the best policy satisfies them, and entropy has a low weight. Fails the test
// for an unknown name.
AlgorithmConfig ProblemSolvingConfig(const AlgorithmId& id);

// An algorithm after `updates` updates on the problem's data, and what it has learned.
class TrainedOnProblem {
 public:
  TrainedOnProblem(const KnownProblem& problem, const AlgorithmConfig& config, int updates);

  const Algorithm& algorithm() const { return *algorithm_; }
  bool Has(const std::string& network) const { return policy_->snapshot().Find(network) != nullptr; }

  // Returns the action in each state [1 x states], chosen by `mode`.
  MatrixX<float> Act(ActingMode mode);
  // Returns Q(s, a), the smaller twin.
  double Value(int state, double action);
  // Returns the probability that the named policy gives to an action. Discrete actions only.
  double Probability(const std::string& network, int state, int action);
  // Returns the named Gaussian policy's mean after the tanh. Continuous actions of one dimension only.
  double Mean(const std::string& network, int state);

 private:
  MatrixX<float> Masks() const;  // [actions x states], [0 x states] where continuous
  MatrixX<float> Output(const std::string& network, const MatrixX<float>& input) const;

  const KnownProblem problem_;
  std::unique_ptr<Algorithm> algorithm_;
  std::shared_ptr<const PolicyNetworks> policy_;
  PolicyRunner runner_;
  Rng rng_{7};
};

}  // namespace dbr
