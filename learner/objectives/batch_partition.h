// D+ and D- of one batch, as weights of a likelihood.
#pragma once

#include "absl/types/span.h"
#include "core/batch.h"

namespace dbr {

// Sorts a batch by its newest advantages A: A >= 0 is in D+, A <= -margin in D-. Reused from batch to batch.
// One thread at a time.
template <class Scalar>
class BatchPartition {
 public:
  // Sets plus() and minus() [n] from the advantages [n].
  void Split(absl::Span<const float> advantages, float margin) {
    const Eigen::Map<const Eigen::VectorXf> a(advantages.data(),
                                              static_cast<Eigen::Index>(advantages.size()));
    plus_ = (a.array() >= 0).template cast<Scalar>();
    minus_ = (a.array() <= -margin).template cast<Scalar>();
    for (VectorX<Scalar>* weights : {&plus_, &minus_}) {
      const Scalar share = weights->mean();
      if (share > 0) *weights /= share;
    }
  }

  // The weights of the transitions in a part: their mean over the batch is 1, and those outside have 0. All
  // are 0 where the part is empty.
  const VectorX<Scalar>& plus() const { return plus_; }
  const VectorX<Scalar>& minus() const { return minus_; }
  bool has_plus() const { return plus_.maxCoeff() > 0; }
  bool has_minus() const { return minus_.maxCoeff() > 0; }

 private:
  VectorX<Scalar> plus_, minus_;  // [n]
};

}  // namespace dbr
