// The Lagrange multiplier of a constraint: DBR's and BEAR's constraints on a divergence, and SAC's on the
// entropy (its temperature).
#pragma once

#include <algorithm>
#include <cmath>

#include "absl/status/status.h"
#include "learner/training/tensor_state.h"
#include "nn/adam.h"

namespace dbr {

struct MultiplierLimits {
  double min_log = -5;  // as in BEAR's code
  double max_log = 10;
};

// The multiplier alpha = exp(log_alpha). Adam makes gradient ascent on alpha * violation. One thread at a
// time.
template <class Scalar>
class Multiplier {
 public:
  Multiplier(double first_value, double learning_rate, const MultiplierLimits& limits = {})
      : limits_(limits),
        log_alpha_(VectorX<Scalar>::Constant(1, static_cast<Scalar>(std::log(first_value)))),
        gradient_(VectorX<Scalar>::Zero(1)),
        adam_(1, learning_rate) {}

  Scalar value() const { return std::exp(log_alpha_[0]); }

  // Makes one step. The multiplier grows where `violation` is above 0 (for a divergence, violation = D - c)
  // and falls where it is below 0.
  void Step(Scalar violation) {
    gradient_[0] = -value() * violation;
    adam_.Step(gradient_, &log_alpha_);
    log_alpha_[0] =
        std::clamp(log_alpha_[0], static_cast<Scalar>(limits_.min_log), static_cast<Scalar>(limits_.max_log));
  }

  void Save(TensorFile* file) const {
    Multiplier& self = const_cast<Multiplier&>(*this);
    PutTensor("log_alpha", self.log_alpha_, file);
    PutTensor("log_alpha.adam.first", self.adam_.first_moment(), file);
    PutTensor("log_alpha.adam.second", self.adam_.second_moment(), file);
    PutCounter("log_alpha.adam.steps", adam_.steps(), file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = GetTensor("log_alpha", file, &log_alpha_);
    status.Update(GetTensor("log_alpha.adam.first", file, &adam_.first_moment()));
    status.Update(GetTensor("log_alpha.adam.second", file, &adam_.second_moment()));
    std::uint64_t steps = 0;
    status.Update(GetCounter("log_alpha.adam.steps", file, &steps));
    adam_.set_steps(steps);
    return status;
  }

 private:
  MultiplierLimits limits_;
  VectorX<Scalar> log_alpha_;
  VectorX<Scalar> gradient_;
  Adam<Scalar> adam_;
};

}  // namespace dbr
