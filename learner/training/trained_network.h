// A network with what training it needs: parameters, optimizer, gradient, and where asked a Polyak target.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "core/rng.h"
#include "core/safetensors.h"
#include "learner/training/tensor_state.h"
#include "nn/adam.h"
#include "nn/mlp.h"

namespace dbr {

// Plain value; one thread at a time.
template <class Scalar>
class TrainedNetwork {
 public:
  TrainedNetwork(const MlpShape& shape, double learning_rate, bool with_target, Rng& rng)
      : shape_(shape),
        parameters_(InitialParameters<Scalar>(shape, rng)),
        adam_(shape.parameter_count(), learning_rate),
        gradient_(VectorX<Scalar>::Zero(shape.parameter_count())) {
    if (with_target) target_ = parameters_;
  }

  const MlpShape& shape() const { return shape_; }
  VectorX<Scalar>& parameters() { return parameters_; }
  const VectorX<Scalar>& parameters() const { return parameters_; }
  const VectorX<Scalar>& target() const { return target_; }
  const VectorX<Scalar>& gradient() const { return gradient_; }
  // For a caller that computes the gradient itself and then steps by ApplyGradient.
  VectorX<Scalar>& gradient() { return gradient_; }

  // [output x n] of the online network; keeps what Step needs.
  const MatrixX<Scalar>& Forward(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, parameters_.data(), x, &activations_);
  }
  // [output x n] of the online network where no gradient is asked for; leaves what Forward keeps alone.
  const MatrixX<Scalar>& Evaluate(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, parameters_.data(), x, &target_activations_);
  }
  // [output x n] of the target network; no gradient is taken through it.
  const MatrixX<Scalar>& ForwardTarget(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, target_.data(), x, &target_activations_);
  }
  // [output x n] of the online network for InputGradient; leaves what Forward keeps alone.
  const MatrixX<Scalar>& ForwardForInput(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, parameters_.data(), x, &input_activations_);
  }
  // The gradient with respect to the x [input x n] of the newest ForwardForInput.
  void InputGradient(const ConstMatrixRef<Scalar>& d_output, MatrixX<Scalar>* d_x) {
    MlpInputGradient(shape_, parameters_.data(), d_output, &input_activations_, d_x);
  }
  // The gradient for the newest Forward(x) from the loss's gradient with respect to its output.
  void ComputeGradient(const ConstMatrixRef<Scalar>& x, const ConstMatrixRef<Scalar>& d_output) {
    MlpParameterGradient(shape_, parameters_.data(), x, d_output, &activations_, &gradient_);
  }
  // ComputeGradient, then one Adam step.
  void Step(const ConstMatrixRef<Scalar>& x, const ConstMatrixRef<Scalar>& d_output) {
    ComputeGradient(x, d_output);
    ApplyGradient();
  }
  // One Adam step on gradient().
  void ApplyGradient() { adam_.Step(gradient_, &parameters_); }
  void set_learning_rate(double learning_rate) { adam_.set_learning_rate(learning_rate); }
  // Lets the target, where there is one, start again from the online network.
  void ResetTarget() {
    if (target_.size() > 0) target_ = parameters_;
  }
  // Polyak averaging of the target, where there is one.
  void UpdateTarget(double tau) {
    if (target_.size() > 0) PolyakUpdate(parameters_, static_cast<Scalar>(tau), &target_);
  }

  void Save(const std::string& name, TensorFile* file) const {
    TrainedNetwork& self = const_cast<TrainedNetwork&>(*this);
    self.Visit(name, [&](const std::string& key, VectorX<Scalar>& values) { PutTensor(key, values, file); });
    PutCounter(name + ".adam.steps", adam_.steps(), file);
  }
  absl::Status Load(const std::string& name, const TensorFile& file) {
    absl::Status status;
    Visit(name, [&](const std::string& key, VectorX<Scalar>& values) {
      status.Update(GetTensor(key, file, &values));
    });
    std::uint64_t steps = 0;
    status.Update(GetCounter(name + ".adam.steps", file, &steps));
    adam_.set_steps(steps);
    return status;
  }

 private:
  template <class Function>
  void Visit(const std::string& name, const Function& function) {
    function(name, parameters_);
    if (target_.size() > 0) function(name + ".target", target_);
    function(name + ".adam.first", adam_.first_moment());
    function(name + ".adam.second", adam_.second_moment());
  }

  MlpShape shape_;
  VectorX<Scalar> parameters_;
  VectorX<Scalar> target_;
  Adam<Scalar> adam_;
  VectorX<Scalar> gradient_;
  MlpActivations<Scalar> activations_;
  MlpActivations<Scalar> target_activations_;
  MlpActivations<Scalar> input_activations_;
};

}  // namespace dbr
