// Behavior Regularized Actor Critic over continuous actions (Wu, Tucker, Nachum 2019, "Behavior Regularized
// Offline Reinforcement Learning").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/objectives/behavior_kl_objective.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/gaussian_likelihood.h"
#include "learner/training/actor_critic.h"
#include "learner/training/multiplier.h"

namespace dbr {

// State: a policy pi with a target pi', twin critics with targets, a behaviour policy beta (tanh-Gaussian)
// and a multiplier alpha. One thread at a time. One update on a batch B drawn uniformly from D:
//   1. beta maximises the mean of log beta(a|s) over B.
//   2. y = r + discount * V'(s'), where V' = w min_i Q'_i + (1 - w) max_i Q'_i at one draw a' from pi' (the
//      paper's weighted mixture of an ensemble, w = target_min_weight). The variant VP (the paper's value
//      penalty) subtracts alpha * (log pi'(a'|s') - log beta(a'|s')) from V'. Each critic regresses on y.
//   3. pi minimises -E[min_i mean_k Q_i(s, a_k)] + alpha * KL(pi || beta). Both terms use the same
//      divergence_samples draws a_k from pi (the paper's policy regularisation,
//      learner/objectives/behavior_kl_objective.h).
//   4. With adaptive_multiplier, alpha ascends on alpha * (KL - epsilon). Otherwise alpha is constant.
//   5. Polyak averaging of the critics and of pi.
//   6. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin before its step, and V is the mean
//      of the smaller twin over the draws of step 3.
// Departures from the paper: beta is fitted during training, not beforehand. (warm_start_updates leaves the Q
// term out at first and so gives beta time.) Step 3 takes beta from before step 1's gradient step, so that
// nothing is computed twice. The target's draw comes from pi', not from pi.
template <class Scalar>
class Brac : public ActorCriticAlgorithm<ActorCritic<Scalar>> {
 public:
  explicit Brac(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;
  void Save(TensorFile* file) const;
  absl::Status Load(const TensorFile& file);

 private:
  using Base = ActorCriticAlgorithm<ActorCritic<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const BracConfig& config() const { return networks_.spec.config.brac(); }
  // Writes V'(s') [n] into next_value_.
  void ComputeNextValue(const BasicBatch<Scalar>& batch);
  BehaviorKlLoss<Scalar> ImprovePolicy(const BasicBatch<Scalar>& batch);

  TrainedNetwork<Scalar> behavior_;
  Multiplier<Scalar> multiplier_;

  GaussianLikelihood<Scalar> beta_{kBehaviorLogStd};
  CriticRegression<Scalar> regression_;
  GaussianHead<Scalar> pi_, next_pi_, next_beta_;
  SampledActions<Scalar> next_draws_;
  BehaviorKlObjective<Scalar> objective_;
  // [dimensions x divergence_samples * n], [dimensions x n] and [2 * dimensions x n].
  MatrixX<Scalar> noise_, next_noise_, d_output_;
  VectorX<Scalar> next_value_, next_kl_, value_;  // [n]
};

std::unique_ptr<Algorithm> MakeBrac(const AlgorithmSpec& spec);

}  // namespace dbr
