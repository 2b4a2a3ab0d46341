// The critics' step of conservative Q-learning, calibrated by the data's returns.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/batch.h"
#include "learner/objectives/continuous_losses.h"
#include "learner/objectives/critic_target.h"
#include "learner/training/critic_ensemble.h"

namespace dbr {

// Actions at the states of a batch over which the conservative term sums: `count` draws for each of n states,
// draw k of state j in column k * n + j.
template <class Scalar>
struct ConservativeDraws {
  MatrixX<Scalar> actions;     // [dimensions x count * n]
  VectorX<Scalar> log_prob;    // [count * n] the density with which each was drawn
  Eigen::Index unbounded = 0;  // the first columns, whose Q the returns do not bound from below
};

template <class Scalar>
struct ConservativeTerm {
  double weight = 5;
  bool calibrated = true;
};

// Returns the mean over n states of
//   (q_j - y_j)^2 + weight * (log sum_k exp(Q_jk) / p_jk - q_j)
// where q_j is the critic at the data's action of state j, Q_jk at its draw k and p_jk the draw's density
// (Kumar et al. 2020, equation 4, with the importance weights of their appendix F). Calibrated, Q_jk counts
// as at least `floor`_j where draw k is a policy's (Nakamoto et al. 2023, equation 5.1). q [1 x n + count *
// n] holds the data's n columns first. Sets `d_q` to the gradient with respect to q. y [n], floor [n] and p
// are constants.
template <class Scalar>
Scalar ConservativeLoss(const MatrixX<Scalar>& q, const VectorX<Scalar>& y, const VectorX<Scalar>& floor,
                        const ConservativeDraws<Scalar>& draws, const ConservativeTerm<Scalar>& term,
                        MatrixX<Scalar>* d_q) {
  const Eigen::Index n = y.size(), count = draws.actions.cols() / n;
  const Scalar weight = static_cast<Scalar>(term.weight), each = weight / static_cast<Scalar>(n);
  d_q->resize(1, q.cols());
  Scalar sum = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto column = [n, j](Eigen::Index k) { return k * n + j; };
    const auto bounded = [&](Eigen::Index k) {
      return term.calibrated && column(k) >= draws.unbounded && q(0, n + column(k)) < floor[j];
    };
    const auto exponent = [&](Eigen::Index k) {
      return (bounded(k) ? floor[j] : q(0, n + column(k))) - draws.log_prob[column(k)];
    };
    Scalar greatest = exponent(0), total = 0;
    for (Eigen::Index k = 1; k < count; ++k) greatest = std::max(greatest, exponent(k));
    for (Eigen::Index k = 0; k < count; ++k) total += std::exp(exponent(k) - greatest);
    for (Eigen::Index k = 0; k < count; ++k) {
      (*d_q)(0, n + column(k)) = bounded(k) ? Scalar{0} : each * std::exp(exponent(k) - greatest) / total;
    }
    const Scalar error = q(0, j) - y[j];
    (*d_q)(0, j) = 2 * error / static_cast<Scalar>(n) - each;
    sum += error * error + weight * (greatest + std::log(total) - q(0, j));
  }
  return sum / static_cast<Scalar>(n);
}

// Fits the critics, with workspaces that are reused from batch to batch. One thread at a time.
template <class Scalar>
class ConservativeRegression {
 public:
  // Makes one step of all critics on ConservativeLoss with y = reward_scale * r + discount * V'(s') and the
  // floor reward_scale * R. next_value [n] is V'(s'). Returns the mean of the critics' losses. Requires
  // returns where calibrated. The batch must not be empty.
  Scalar Fit(const BasicBatch<Scalar>& batch, double reward_scale, const VectorX<Scalar>& next_value,
             const ConservativeDraws<Scalar>& draws, const ConservativeTerm<Scalar>& term,
             CriticEnsemble<Scalar>* critics) {
    const Eigen::Index n = batch.size(), drawn = draws.actions.cols();
    CriticTarget(batch, reward_scale, next_value, &target_);
    if (term.calibrated) floor_ = static_cast<Scalar>(reward_scale) * batch.returns;
    inputs_.resize(batch.observations.rows() + batch.actions.rows(), n + drawn);
    for (Eigen::Index first = 0; first < n + drawn; first += n) {
      inputs_.block(0, first, batch.observations.rows(), n) = batch.observations;
    }
    inputs_.bottomLeftCorner(batch.actions.rows(), n) = batch.actions;
    inputs_.bottomRightCorner(batch.actions.rows(), drawn) = draws.actions;
    const Scalar loss = critics->Fit(inputs_, [&](const MatrixX<Scalar>& q, MatrixX<Scalar>* d_q) {
      return ConservativeLoss<Scalar>(q, target_, floor_, draws, term, d_q);
    });
    behavior_value_.resize(n);
    MeanOfSmaller<Scalar>(critics->q1().leftCols(n), critics->q2().leftCols(n), &behavior_value_);
    SetGap(critics->q1(), n);
    return loss;
  }

  const VectorX<Scalar>& target() const { return target_; }  // [n] y
  // [n] The smaller twin at the batch's actions, from before the step.
  const VectorX<Scalar>& behavior_value() const { return behavior_value_; }
  // The mean of Q_1 at the draws less that at the data's actions, from before the step.
  Scalar gap() const { return gap_; }

 private:
  void SetGap(const MatrixX<Scalar>& q, Eigen::Index n) {
    gap_ = q.rightCols(q.cols() - n).mean() - q.leftCols(n).mean();
  }

  VectorX<Scalar> target_, behavior_value_, floor_;  // [n]
  MatrixX<Scalar> inputs_;                           // [observation + dimensions x n + drawn]
  Scalar gap_ = 0;
};

}  // namespace dbr
