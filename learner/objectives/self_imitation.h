// The clipped advantage of self-imitation (Oh et al. 2018, "Self-Imitation Learning", equations 1 and 2).
#pragma once

#include "core/batch.h"
#include "core/check.h"

namespace dbr {

// Judges a batch by what its episodes really earned. Reused from batch to batch.
template <class Scalar>
class SelfImitation {
 public:
  // A = reward_scale * R - V(s) of each transition, R its Monte-Carlo return, `value` [n] V(s), a constant;
  // and the weights max(A, 0) / mean of max(A, 0), so that their mean is 1 whatever the rewards' size.
  void Judge(const BasicBatch<Scalar>& batch, double reward_scale, const VectorX<Scalar>& value) {
    DBR_CHECK(batch.returns.size() == batch.size());
    advantage_ = static_cast<Scalar>(reward_scale) * batch.returns - value;
    weights_ = advantage_.cwiseMax(Scalar{0});
    const Scalar mean = weights_.mean();
    imitates_ = mean > 0;
    if (imitates_) weights_ /= mean;
  }

  const VectorX<Scalar>& advantage() const { return advantage_; }  // [n]
  // False where no transition did better than V(s): there is nothing to imitate and weights() are all 0.
  bool imitates() const { return imitates_; }
  const VectorX<Scalar>& weights() const { return weights_; }  // [n]

 private:
  VectorX<Scalar> advantage_, weights_;
  bool imitates_ = false;
};

}  // namespace dbr
