// Small problems with closed-form answers, and what algorithms say of them after training.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "nn/policy.h"

namespace dbr {

// A finite problem over one-hot states. Data: uniformly random states and legal actions.
struct KnownProblem {
  // What follows an action in a state.
  struct Outcome {
    double reward = 0;
    int next_state = 0;
  };

  ActionSpace actions;  // discrete, or one dimension in [-1, 1]
  int states = 1;
  double discount = 0;
  Outcome (*outcome)(int state, double action) = nullptr;
  bool (*legal)(int state, int action) = nullptr;  // discrete; null: all are
};

// The config, other than its defaults, by which the named algorithm should solve such problems in a few
// hundred updates. Constraints are loosened so far that the best policy keeps them, and entropies priced low.
// Fails the test where the name is not known here.
AlgorithmConfig ProblemSolvingConfig(const AlgorithmId& id);

// An algorithm after `updates` updates on the problem's data, and what it has learned.
class TrainedOnProblem {
 public:
  TrainedOnProblem(const KnownProblem& problem, const AlgorithmConfig& config, int updates);

  const Algorithm& algorithm() const { return *algorithm_; }
  bool Has(const std::string& network) const { return policy_->snapshot().Find(network) != nullptr; }

  // The action in each state [1 x states] by `mode`.
  MatrixX<float> Act(ActingMode mode);
  // Q(s, a), the smaller twin.
  double Value(int state, double action);
  // The probability that the named policy gives to an action; discrete.
  double Probability(const std::string& network, int state, int action);
  // The named Gaussian policy's mean after the tanh; continuous, one dimension.
  double Mean(const std::string& network, int state);

 private:
  MatrixX<float> Masks() const;  // [actions x states], [0 x states] where continuous
  MatrixX<float> Output(const std::string& network, const MatrixX<float>& input, const MlpShape& shape) const;

  const KnownProblem problem_;
  std::unique_ptr<Algorithm> algorithm_;
  std::shared_ptr<const PolicyNetworks> policy_;
  PolicyRunner runner_;
  Rng rng_{7};
};

}  // namespace dbr
