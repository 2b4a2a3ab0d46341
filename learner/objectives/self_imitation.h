// The clipped advantage of self-imitation (Oh et al. 2018, "Self-Imitation Learning", equations 1 and 2).
#pragma once

#include "core/batch.h"
#include "core/check.h"

namespace dbr {

// Computes advantages from the returns that the batch's episodes earned. Reused from batch to batch. One
// thread at a time.
template <class Scalar>
class SelfImitation {
 public:
  // Sets advantage() to A = reward_scale * R - V(s) for each transition. R is its Monte-Carlo return, and
  // `value` [n] is V(s), a constant. Sets weights() to max(A, 0) / mean of max(A, 0), so that their mean is 1
  // at any size of the rewards. Requires a batch with returns.
  void Judge(const BasicBatch<Scalar>& batch, double reward_scale, const VectorX<Scalar>& value) {
    DBR_CHECK(batch.returns.size() == batch.size());
    advantage_ = static_cast<Scalar>(reward_scale) * batch.returns - value;
    weights_ = advantage_.cwiseMax(Scalar{0});
    const Scalar mean = weights_.mean();
    imitates_ = mean != 0;  // a NaN goes on into the weights
    if (imitates_) weights_ /= mean;
  }

  const VectorX<Scalar>& advantage() const { return advantage_; }  // [n]
  // False where no transition did better than V(s). There is then nothing to imitate and all weights() are 0.
  bool imitates() const { return imitates_; }
  const VectorX<Scalar>& weights() const { return weights_; }  // [n]

 private:
  VectorX<Scalar> advantage_, weights_;  // [n]
  bool imitates_ = false;
};

}  // namespace dbr
