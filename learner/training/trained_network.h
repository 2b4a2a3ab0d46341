// A network with everything that its training needs: parameters, an optimizer, a gradient and, where asked, a
// Polyak target.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "core/rng.h"
#include "core/safetensors.h"
#include "learner/training/tensor_state.h"
#include "nn/adam.h"
#include "nn/mlp.h"

namespace dbr {

// Owns its parameters. It can be copied. One thread at a time. Inputs x are [input x n].
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
  // For a caller that computes the gradient itself and then calls ApplyGradient.
  VectorX<Scalar>& gradient() { return gradient_; }

  // Returns the online network's output [output x n] and keeps what Step needs. The results of this and the
  // next three functions are valid until the next call that uses the same workspace.
  const MatrixX<Scalar>& Forward(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, parameters_.data(), x, &activations_);
  }
  // Returns the online network's output [output x n] without keeping anything for a gradient. What Forward
  // kept stays valid. Evaluate and ForwardTarget share a workspace.
  const MatrixX<Scalar>& Evaluate(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, parameters_.data(), x, &target_activations_);
  }
  // Returns the target network's output [output x n]. No gradient can be taken through it. Requires a target.
  const MatrixX<Scalar>& ForwardTarget(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, target_.data(), x, &target_activations_);
  }
  // Returns the online network's output [output x n] and keeps what InputGradient needs. What Forward kept
  // stays valid.
  const MatrixX<Scalar>& ForwardForInput(const ConstMatrixRef<Scalar>& x) {
    return MlpForward(shape_, parameters_.data(), x, &input_activations_);
  }
  // Computes the gradient with respect to the x [input x n] of the newest ForwardForInput.
  void InputGradient(const ConstMatrixRef<Scalar>& d_output, MatrixX<Scalar>* d_x) {
    MlpInputGradient(shape_, parameters_.data(), d_output, &input_activations_, d_x);
  }
  // Computes gradient() for the newest Forward(x) from the gradient of the loss with respect to its output
  // [output x n].
  void ComputeGradient(const ConstMatrixRef<Scalar>& x, const ConstMatrixRef<Scalar>& d_output) {
    MlpParameterGradient(shape_, parameters_.data(), x, d_output, &activations_, &gradient_);
  }
  // Calls ComputeGradient and makes one Adam step.
  void Step(const ConstMatrixRef<Scalar>& x, const ConstMatrixRef<Scalar>& d_output) {
    ComputeGradient(x, d_output);
    ApplyGradient();
  }
  // Makes one Adam step on gradient().
  void ApplyGradient() { adam_.Step(gradient_, &parameters_); }
  void set_learning_rate(double learning_rate) { adam_.set_learning_rate(learning_rate); }
  // Copies the online network into the target, where there is one.
  void ResetTarget() {
    if (target_.size() > 0) target_ = parameters_;
  }
  // Polyak averages the target, where there is one: target += tau * (online - target).
  void UpdateTarget(double tau) {
    if (target_.size() > 0) PolyakUpdate(parameters_, static_cast<Scalar>(tau), &target_);
  }

  void Save(const std::string& name, TensorFile* file) const {
    TrainedNetwork& self = const_cast<TrainedNetwork&>(*this);
    self.Visit(name, [&](const std::string& key, VectorX<Scalar>& values) { PutTensor(key, values, file); });
    PutCounter(name + ".adam.steps", adam_.steps(), file);
  }
  // Returns DataLoss where a tensor or counter is missing and InvalidArgument where a tensor has another
  // size.
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
