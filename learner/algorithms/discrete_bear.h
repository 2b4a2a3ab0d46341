// Bootstrapping Error Accumulation Reduction (Kumar et al. 2019) over discrete actions, built on discrete SAC
// (Christodoulou 2019).
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/bear_networks.h"
#include "learner/objectives/categorical_likelihood.h"
#include "learner/objectives/discrete_losses.h"

namespace dbr {

// State: a policy pi (a softmax over the legal actions) with a target pi', twin critics with targets, a
// behaviour policy beta of pi's shape, and a multiplier alpha. One thread at a time. One update on a batch B
// drawn uniformly from D:
//   1. beta maximises the mean of log beta(a|s) over B.
//   2. y = r + discount * V'(s'), where V' is the expectation under pi' of w min_i Q'_i + (1 - w) max_i Q'_i,
//      w = target_min_weight. Each critic regresses on y.
//   3. pi minimises -E[min_i E_pi Q_i] - entropy_weight * H(pi) + alpha * (D(pi, beta) - eps), with D exact.
//      In the first warm_start_updates updates the Q term is left out.
//   4. alpha ascends on alpha * (D(pi, beta) - eps).
//   5. Polyak averaging of the critics and of pi.
//   6. A = Q(s, a) - V(s) for every transition of B. Q is the smaller twin, and V is its expectation under
//      pi.
// Departures from the paper: BEAR is for continuous actions. Here expectations are exact where BEAR samples,
// and beta is a softmax in place of the VAE. Steps 3 and 6 use beta, the critics and the policy as they were
// before their steps in this update, so that nothing is computed twice.
template <class Scalar>
class DiscreteBear : public ActorCriticAlgorithm<BearNetworks<Scalar>> {
 public:
  explicit DiscreteBear(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const;
  void ExportPolicy(PolicySnapshot* snapshot) const;
  void Save(TensorFile* file) const;
  absl::Status Load(const TensorFile& file);

 private:
  using Base = ActorCriticAlgorithm<BearNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  Scalar FitCritics(const BasicBatch<Scalar>& batch);
  ConstrainedLoss<Scalar> ImprovePolicy(const BasicBatch<Scalar>& batch);

  PolicyLossOptions options_;
  TrainedNetwork<Scalar> behavior_;

  CategoricalLikelihood<Scalar> beta_;
  Categorical<Scalar> pi_, next_pi_;
  PolicyLossWorkspace<Scalar> workspace_;
  VectorX<Scalar> target_, value_;  // [n]
  MatrixX<Scalar> d_logits_;        // [actions x n]
};

std::unique_ptr<Algorithm> MakeDiscreteBear(const AlgorithmSpec& spec);

}  // namespace dbr
