// Adam (Kingma and Ba 2015) over one flat parameter vector.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/batch.h"

namespace dbr {

// The optimizer's state for one parameter vector, which the caller owns: both moments and the number of
// steps. Bias-corrected as in the paper's algorithm 1, without weight decay. One thread at a time.
template <class Scalar>
class Adam {
 public:
  Adam() = default;  // for no parameters
  Adam(Eigen::Index size, double learning_rate)
      : learning_rate_(learning_rate),
        first_(VectorX<Scalar>::Zero(size)),
        second_(VectorX<Scalar>::Zero(size)) {}

  // parameters -= learning_rate * m^ / (sqrt(v^) + 1e-8), in one pass. `gradient` and `parameters` have the
  // optimizer's size. O(size), allocates nothing.
  void Step(const VectorX<Scalar>& gradient, VectorX<Scalar>* parameters) {
    BeginStep();
    StepPart(gradient.data(), 0, gradient.size(), parameters->data());
  }

  // The same in parts, for a caller that does more with a part while it is in the cache: BeginStep, then
  // StepPart for entries first ... first + n of both vectors, each entry once.
  void BeginStep() {
    ++steps_;
    const double t = static_cast<double>(steps_);
    step_ = static_cast<Scalar>(learning_rate_ / (1 - std::pow(kBeta1, t)));
    root_correction_ = static_cast<Scalar>(1 / std::sqrt(1 - std::pow(kBeta2, t)));
  }
  void StepPart(const Scalar* gradient, Eigen::Index first, Eigen::Index n, Scalar* parameters) {
    const auto b1 = static_cast<Scalar>(1 - kBeta1), b2 = static_cast<Scalar>(1 - kBeta2);
    const auto epsilon = static_cast<Scalar>(kEpsilon);
    const Scalar step = step_, root_correction = root_correction_;
    const Scalar* __restrict g = gradient + first;
    Scalar* __restrict m = first_.data() + first;
    Scalar* __restrict v = second_.data() + first;
    Scalar* __restrict p = parameters + first;
    for (Eigen::Index i = 0; i < n; ++i) {
      m[i] += b1 * (g[i] - m[i]);
      v[i] += b2 * (g[i] * g[i] - v[i]);
      p[i] -= step * m[i] / (std::sqrt(v[i]) * root_correction + epsilon);
    }
  }

  void set_learning_rate(double learning_rate) { learning_rate_ = learning_rate; }
  std::uint64_t steps() const { return steps_; }
  void set_steps(std::uint64_t steps) { steps_ = steps; }
  VectorX<Scalar>& first_moment() { return first_; }
  VectorX<Scalar>& second_moment() { return second_; }

 private:
  static constexpr double kBeta1 = 0.9, kBeta2 = 0.999, kEpsilon = 1e-8;

  double learning_rate_ = 0;
  std::uint64_t steps_ = 0;
  Scalar step_ = 0, root_correction_ = 0;  // of the step that BeginStep began
  VectorX<Scalar> first_;
  VectorX<Scalar> second_;
};

}  // namespace dbr
