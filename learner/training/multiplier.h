// The Lagrange multiplier of a constraint: DBR's and BEAR's constraints on a divergence, and SAC's on the
// entropy (its temperature).
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/status/status.h"
#include "learner/training/tensor_state.h"
#include "nn/adam.h"

namespace dbr {

struct MultiplierLimits {
  double min_log = -5;  // as in BEAR's code
  double max_log = 10;
  double offset = 0;  // what is taken off exp(log_alpha)

  // The limits of a multiplier between `min` and `max`. A `min` of 0 is reached at log_alpha = -5, so that
  // the multiplier can leave it again within the steps that it takes elsewhere.
  static MultiplierLimits Between(double min, double max) {
    MultiplierLimits limits;
    if (min > 0) {
      limits.min_log = std::log(min);
    } else {
      limits.offset = std::exp(limits.min_log);
    }
    limits.max_log = std::log(max + limits.offset);
    return limits;
  }
};

// The limits of a temperature. It may fall low where rewards are small. Above e^5 training has failed.
inline constexpr MultiplierLimits kTemperatureLimits{.min_log = -20, .max_log = 5};

// The multiplier alpha = exp(log_alpha), less the limits' offset. Adam makes gradient ascent on alpha *
// violation. One thread at a time.
template <class Scalar>
class Multiplier {
 public:
  Multiplier(double first_value, double learning_rate, const MultiplierLimits& limits = {})
      : limits_(limits),
        log_alpha_(VectorX<Scalar>::Constant(1, static_cast<Scalar>(std::log(first_value + limits.offset)))),
        gradient_(VectorX<Scalar>::Zero(1)),
        adam_(1, learning_rate) {}

  Scalar value() const {
    return log_alpha_[0] <= min_log() ? LowestValue() : exponential() - static_cast<Scalar>(limits_.offset);
  }

  // Makes one step. The multiplier grows where `violation` is above 0 (for a divergence, violation = D - c)
  // and falls where it is below 0. At a limit no step is made that leads beyond it: Adam's moments would
  // gather what has to be undone later, when the violation changes its sign.
  void Step(Scalar violation) {
    if ((log_alpha_[0] >= max_log() && violation > 0) || (log_alpha_[0] <= min_log() && violation < 0))
      return;
    gradient_[0] = -exponential() * violation;
    adam_.Step(gradient_, &log_alpha_);
    log_alpha_[0] = std::clamp(log_alpha_[0], min_log(), max_log());
  }

  // `name` is that of log_alpha's tensor. An object with two multipliers names the second one otherwise.
  void Save(TensorFile* file, const std::string& name = kName) const {
    Multiplier& self = const_cast<Multiplier&>(*this);
    PutTensor(name, self.log_alpha_, file);
    PutTensor(name + ".adam.first", self.adam_.first_moment(), file);
    PutTensor(name + ".adam.second", self.adam_.second_moment(), file);
    PutCounter(name + ".adam.steps", adam_.steps(), file);
  }
  absl::Status Load(const TensorFile& file, const std::string& name = kName) {
    absl::Status status = GetTensor(name, file, &log_alpha_);
    status.Update(GetTensor(name + ".adam.first", file, &adam_.first_moment()));
    status.Update(GetTensor(name + ".adam.second", file, &adam_.second_moment()));
    std::uint64_t steps = 0;
    status.Update(GetCounter(name + ".adam.steps", file, &steps));
    adam_.set_steps(steps);
    return status;
  }

 private:
  static constexpr char kName[] = "log_alpha";

  Scalar min_log() const { return static_cast<Scalar>(limits_.min_log); }
  Scalar max_log() const { return static_cast<Scalar>(limits_.max_log); }
  Scalar exponential() const { return std::exp(log_alpha_[0]); }
  // What value() is at min_log, without the rounding of an exponential.
  Scalar LowestValue() const { return limits_.offset > 0 ? Scalar{0} : exponential(); }

  MultiplierLimits limits_;
  VectorX<Scalar> log_alpha_;
  VectorX<Scalar> gradient_;
  Adam<Scalar> adam_;
};

}  // namespace dbr
