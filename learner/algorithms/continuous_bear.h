// Bootstrapping Error Accumulation Reduction over continuous actions (Kumar et al. 2019, "Stabilizing
// Off-Policy Q-Learning via Bootstrapping Error Reduction").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/bear_networks.h"
#include "learner/objectives/bear_objective.h"
#include "learner/objectives/critic_regression.h"
#include "learner/objectives/greatest_target.h"
#include "learner/training/behavior_vae.h"

namespace dbr {

// State: a policy pi (tanh-Gaussian) with a target pi', twin critics with targets, a conditional VAE as the
// behaviour model beta, and a multiplier alpha. One thread at a time. One update on a batch B drawn uniformly
// from D:
//   1. The VAE takes a step on its loss over B (nn/cvae.h).
//   2. y = r + discount * V'(s'), where V' is the greatest value of w min_i Q'_i + (1 - w) max_i Q'_i over
//      target_samples draws from pi', w = target_min_weight. Each critic regresses on y (the paper's
//      algorithm 1).
//   3. pi minimises -E[min_i mean_k Q_i(s, a_k)] + alpha * (MMD(pi, beta) - eps), where the a_k are
//      policy_samples draws from pi. The MMD compares divergence_samples actions a side at the same state,
//      before their tanh. beta's actions are decoded from latents of N(0, 1) clipped to +-vae_latent_limit
//      (equation 1 and the paper's section 5). In the first warm_start_updates updates the Q term is left
//      out.
//   4. alpha ascends on alpha * (MMD(pi, beta) - eps).
//   5. Polyak averaging of the critics and of pi.
//   6. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin before its step, and V is the mean
//      of the smaller twin over the draws of step 3.
// Departures from the official code: there are two critics and step 3 takes the smaller one, where the paper
// has an ensemble. The Q term draws from pi anew, where the code takes one of the MMD's draws. pi's log-std
// has the limits of this project's policies. Step 6 is added.
template <class Scalar>
class ContinuousBear : public ActorCriticAlgorithm<BearNetworks<Scalar>> {
 public:
  explicit ContinuousBear(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;
  void Save(TensorFile* file) const;
  absl::Status Load(const TensorFile& file);

 private:
  using Base = ActorCriticAlgorithm<BearNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  const BearConfig& config() const { return networks_.spec.config.bear(); }
  Scalar FitBehavior(const BasicBatch<Scalar>& batch);
  Scalar FitCritics(const BasicBatch<Scalar>& batch);
  ConstrainedLoss<Scalar> ImprovePolicy(const BasicBatch<Scalar>& batch);

  PolicyLossOptions options_;
  BehaviorVae<Scalar> vae_;

  CriticRegression<Scalar> regression_;
  GreatestTarget<Scalar> next_;
  GaussianHead<Scalar> pi_;
  BearObjective<Scalar> objective_;
  // Noise: vae_noise_ [latent x n], next_noise_ [dimensions x target_samples * n], action_noise_
  // [dimensions x policy_samples * n], divergence_noise_ [dimensions x n * divergence_samples], latent_noise_
  // [latent x n * divergence_samples]. d_output_ [2 * dimensions x n].
  MatrixX<Scalar> vae_noise_, next_noise_, action_noise_, divergence_noise_, latent_noise_, d_output_;
  VectorX<Scalar> value_;  // [n]
};

// Returns InvalidArgument unless the divergence is one that samples can estimate: a VAE has no density.
absl::Status CheckContinuousBear(const AlgorithmConfig& config, const std::string& env);
std::unique_ptr<Algorithm> MakeContinuousBear(const AlgorithmSpec& spec);

}  // namespace dbr
