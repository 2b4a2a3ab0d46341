// V'(s') over continuous actions, as BEAR and DBR compute it.
#pragma once

#include <optional>

#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/sampled_actions.h"
#include "learner/training/critic_ensemble.h"
#include "learner/training/trained_network.h"

namespace dbr {

// Computes V'(s'), with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class GreatestTarget {
 public:
  // Evaluates pi', the target of `policy`, at s'. Compute needs it first.
  void EvaluatePolicy(const MatrixX<Scalar>& next_observations, TrainedNetwork<Scalar>* policy) {
    pi_.Split(policy->ForwardTarget(next_observations), kPolicyLogStd);
  }

  // Returns V'(s') [n]: the greatest value of min_weight * min_i Q'_i + (1 - min_weight) * max_i Q'_i over
  // draws from pi' (Kumar et al. 2019, algorithm 1). With a temperature it is the greatest value of that less
  // temperature * log pi'(a'|s'). noise [dimensions x count * n]. No gradient is taken.
  const VectorX<Scalar>& Compute(const MatrixX<Scalar>& next_observations, const MatrixX<Scalar>& noise,
                                 Scalar min_weight, CriticEnsemble<Scalar>* critics,
                                 std::optional<Scalar> temperature = std::nullopt) {
    if (temperature) {
      draws_.Draw(pi_, noise);
    } else {
      draws_.DrawActions(pi_, noise);
    }
    critics->EvaluateTargets(draws_.CriticInput(next_observations));
    value_.resize(next_observations.cols());
    const SoftValue<Scalar> soft{temperature.value_or(0), draws_.sample().log_prob};
    GreatestTargetValue<Scalar>(critics->target1(), critics->target2(), min_weight, &value_,
                                temperature ? &soft : nullptr);
    return value_;
  }

  const GaussianHead<Scalar>& pi() const { return pi_; }  // pi' at the newest next_observations

 private:
  GaussianHead<Scalar> pi_;
  SampledActions<Scalar> draws_;
  VectorX<Scalar> value_;  // [n]
};

}  // namespace dbr
