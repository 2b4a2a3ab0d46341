// Soft Actor-Critic over discrete actions (Christodoulou 2019, "Soft Actor-Critic for Discrete Action
// Settings").
#pragma once

#include <memory>
#include <vector>

#include "learner/algorithms/actor_critic_algorithm.h"
#include "learner/algorithms/soft_networks.h"
#include "nn/categorical.h"

namespace dbr {

// State: a policy pi, twin critics with targets and a temperature. Expectations over actions are exact sums
// over the legal actions. One thread at a time. One update on a batch B drawn uniformly from D:
//   1. y = r + discount * sum_a pi(a|s') (min_i Q'_i(s', a) - temperature * log pi(a|s')) (equation 10). Each
//      critic regresses on y.
//   2. pi minimises E[sum_a pi(a|s) (temperature * log pi(a|s) - min_i Q_i(s, a))] (equation 12).
//   3. The temperature rises where the entropy is below its target and falls above it (equation 11). The
//      target is target_entropy_ratio * log(number of legal actions) for each state. Both are averaged over
//      B.
//   4. Polyak averaging of the critics, and of pi: evaluations play the average.
//   5. A = min_i Q_i(s, a) - sum_a pi(a|s) min_i Q_i(s, a) for every transition of B.
// Departures from the paper: steps 2 and 5 use the critics' values from before step 1's gradient step, and
// step 5 uses the policy from before step 2's, so that nothing is computed twice. Adam moves the log of the
// temperature.
template <class Scalar>
class DiscreteSac : public ActorCriticAlgorithm<SoftNetworks<Scalar>> {
 public:
  explicit DiscreteSac(const AlgorithmSpec& spec);

  // `plus` and `minus` are not used.
  absl::Status Update(const BasicBatch<Scalar>& uniform, const BasicBatch<Scalar>& plus,
                      const BasicBatch<Scalar>& minus);

  double UpdateFlops() const { return networks_.UpdateFlops(this->needs().uniform); }

 private:
  using Base = ActorCriticAlgorithm<SoftNetworks<Scalar>>;
  using Base::metrics_;
  using Base::networks_;

  void ComputeTarget(const BasicBatch<Scalar>& batch);
  SoftPolicyLoss<Scalar> ImprovePolicy(const BasicBatch<Scalar>& batch);

  Categorical<Scalar> pi_, next_pi_;
  VectorX<Scalar> next_value_, target_, value_, entropy_;  // [n]
  MatrixX<Scalar> d_logits_;                               // [actions x n]
};

std::unique_ptr<Algorithm> MakeDiscreteSac(const AlgorithmSpec& spec);

}  // namespace dbr
