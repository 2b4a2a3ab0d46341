// DBR's policy loss over continuous actions with its gradient.
#pragma once

#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/dual_behavior.h"
#include "learner/objectives/gaussian_divergence.h"
#include "learner/objectives/sampled_q_objective.h"
#include "learner/training/critic_ensemble.h"

namespace dbr {

// The standard normal noise of one evaluation of the loss.
template <class Scalar>
struct ObjectiveNoise {
  MatrixX<Scalar> actions;          // [dimensions x samples * n]
  MatrixX<Scalar> pi, plus, minus;  // [dimensions x n * divergence samples]; empty for an exact divergence
};

// The three policies at the states of a batch.
template <class Scalar>
struct PolicyHeads {
  const GaussianHead<Scalar>& pi;
  const GaussianHead<Scalar>& beta_plus;
  const GaussianHead<Scalar>& beta_minus;
};

// What the transitions of the batch did, for the divergence ACTIONS.
template <class Scalar>
struct TakenActions {
  const MatrixX<Scalar>& actions;  // [dimensions x n]
  const VectorX<Scalar>& values;   // [n] what each is worth: Q(s, a), or the return that it earned
};

// Computes the loss, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class DualBehaviorObjective {
 public:
  // Returns -(E[min_i mean_k Q_i(s, a_k)] + w H(pi)) / scale + alpha * (D(pi, beta+) - c), with the a_k drawn
  // from pi. options.constraint sets c (docs/algorithms.md, DBR step 3); NONE leaves that term out. The
  // entropy H is the estimate from the draws. With repel_negative and a max_repulsion, the D(pi, beta-) of
  // which c is the mean is cut at max_repulsion in each state. `d_output` [2 * dimensions x n] becomes the
  // loss's gradient with respect to the output of pi's network. beta+, beta-, alpha, the critics' weights and
  // normalize_q's scale are constants. c is a constant too, unless repel_negative is set.
  //
  // With the divergence ACTIONS beta+ and beta- have no part in it: D(pi, D+) and D(pi, D-) are weighted
  // means of the distance to the actions of `taken` (action_weights.h), whose advantages are values - V(s).
  // The weights are constants.
  PolicyLoss<Scalar> Compute(const PolicyLossOptions& options, const PolicyHeads<Scalar>& heads,
                             const MatrixX<Scalar>& observations, const TakenActions<Scalar>& taken,
                             const ObjectiveNoise<Scalar>& noise, Scalar alpha,
                             CriticEnsemble<Scalar>* critics, MatrixX<Scalar>* d_output);

  // Evaluates the critics at draws from pi, for StateValue alone.
  void Evaluate(const PolicyDraws<Scalar>& at, CriticEnsemble<Scalar>* critics) {
    q_objective_.Evaluate(at, critics);
  }

  // Sets `value` [n] to V(s): the mean of the smaller twin over the draws of the newest Compute or Evaluate.
  // Requires that `value` has its size n.
  void StateValue(const CriticEnsemble<Scalar>& critics, VectorX<Scalar>* value) const {
    MeanOfSmaller<Scalar>(critics.value1(), critics.value2(), value);
  }

 private:
  // Set plus_ and, where it can move the threshold, minus_ with its limit. Report both without the limit.
  void Measure(const PolicyLossOptions& options, const PolicyHeads<Scalar>& heads,
               const ObjectiveNoise<Scalar>& noise, PolicyLoss<Scalar>* result);
  void MeasureActions(const PolicyLossOptions& options, const GaussianHead<Scalar>& pi,
                      const TakenActions<Scalar>& taken, const CriticEnsemble<Scalar>& critics,
                      PolicyLoss<Scalar>* result);
  void AddConstraint(const PolicyLossOptions& options, Scalar alpha, PolicyLoss<Scalar>* result);

  SampledQObjective<Scalar> q_objective_;
  GaussianDivergence<Scalar> plus_, minus_;
  VectorX<Scalar> advantage_, plus_weights_, minus_weights_;  // [n] with ACTIONS
  GaussianGradient<Scalar> gradient_;
};

}  // namespace dbr
