// A network with everything that its training needs: parameters, an optimizer, a gradient and, where asked, a
// Polyak target.
#pragma once

#include <algorithm>
#include <string>
#include <type_traits>

#include "absl/status/status.h"
#include "core/rng.h"
#include "core/safetensors.h"
#include "learner/training/tensor_state.h"
#include "nn/adam.h"
#include "nn/mlp.h"
#include "nn/rounded_weights.h"

namespace dbr {

struct TrainingOptions {
  double learning_rate = 0;
  bool with_target = false;
  bool bfloat16 = false;  // whether products take weights and activations in bfloat16; Scalar is then float
};

// Owns its parameters. It can be moved. One thread at a time. Inputs x are [input x n].
template <class Scalar>
class TrainedNetwork {
 public:
  TrainedNetwork(const MlpShape& shape, const TrainingOptions& options, Rng& rng)
      : shape_(shape),
        parameters_(InitialParameters<Scalar>(shape, rng)),
        adam_(shape.parameter_count(), options.learning_rate),
        gradient_(VectorX<Scalar>::Zero(shape.parameter_count())) {
    if (options.with_target) target_ = parameters_;
    if (options.bfloat16) {
      rounded_ = RoundedWeights(shape);
      if (options.with_target) rounded_target_ = RoundedWeights(shape);
    }
    RoundAll();
  }

  const MlpShape& shape() const { return shape_; }
  const VectorX<Scalar>& parameters() const { return parameters_; }
  // What products read of the online network.
  MlpParameters<Scalar> online() const { return Parameters(parameters_, rounded_); }
  // Replaces the parameters [parameter_count], and those of the target where there is one.
  void SetParameters(const VectorX<Scalar>& parameters) {
    parameters_ = parameters;
    if (target_.size() > 0) target_ = parameters;
    RoundAll();
  }
  const VectorX<Scalar>& target() const { return target_; }
  const VectorX<Scalar>& gradient() const { return gradient_; }
  // For a caller that computes the gradient itself and then calls ApplyGradient.
  VectorX<Scalar>& gradient() { return gradient_; }

  // Returns the online network's output [output x n] and keeps what Step needs. The results of this and the
  // next three functions are valid until the next call that uses the same workspace.
  const MatrixX<Scalar>& Forward(const ConstMatrixRef<Scalar>& x) {
    return MlpForward<Scalar>(shape_, online(), x, &activations_);
  }
  // Returns the online network's output [output x n] without keeping anything for a gradient. What Forward
  // kept stays valid. Evaluate and ForwardTarget share a workspace.
  const MatrixX<Scalar>& Evaluate(const ConstMatrixRef<Scalar>& x) {
    return MlpForward<Scalar>(shape_, online(), x, &target_activations_);
  }
  // Returns the target network's output [output x n]. No gradient can be taken through it. Requires a target.
  const MatrixX<Scalar>& ForwardTarget(const ConstMatrixRef<Scalar>& x) {
    return MlpForward<Scalar>(shape_, Parameters(target_, rounded_target_), x, &target_activations_);
  }
  // Returns the online network's output [output x n] and keeps what InputGradient needs. What Forward kept
  // stays valid.
  const MatrixX<Scalar>& ForwardForInput(const ConstMatrixRef<Scalar>& x) {
    return MlpForward<Scalar>(shape_, online(), x, &input_activations_);
  }
  // Computes the gradient with respect to the last rows of the newest ForwardForInput's x, [rows x n].
  void InputGradient(const ConstMatrixRef<Scalar>& d_output, Eigen::Index rows, MatrixX<Scalar>* d_x) {
    MlpInputGradient<Scalar>(online(), d_output, rows, &input_activations_, d_x);
  }
  // Computes gradient() for the newest Forward(x) from the gradient of the loss with respect to its output
  // [output x n].
  void ComputeGradient(const ConstMatrixRef<Scalar>& x, const ConstMatrixRef<Scalar>& d_output) {
    MlpParameterGradient<Scalar>(online(), x, d_output, &activations_, &gradient_);
  }
  // Calls ComputeGradient and ApplyGradient.
  void Step(const ConstMatrixRef<Scalar>& x, const ConstMatrixRef<Scalar>& d_output) {
    ComputeGradient(x, d_output);
    ApplyGradient();
  }
  // Makes one Adam step on gradient(), moves the target (Polyak averaging: target += tau * (online - target))
  // and rounds both for the products, in one pass over memory.
  void ApplyGradient() {
    adam_.BeginStep();
    for (int layer = 0; layer < shape_.layer_count(); ++layer) {
      const Eigen::Index rows = shape_.out(layer), columns = shape_.in(layer);
      const Eigen::Index group = std::max<Eigen::Index>(1, kGroupEntries / rows);
      for (Eigen::Index first = 0; first < columns; first += group) {
        const Eigen::Index n = std::min(group, columns - first);
        const Eigen::Index offset = shape_.weight_offset(layer) + first * rows;
        StepPart(offset, n * rows);
        if constexpr (std::is_same_v<Scalar, float>) {
          if (!rounded_.empty()) rounded_.Round(layer, first, n, parameters_.data() + offset);
          if (moves_target() && !rounded_target_.empty()) {
            rounded_target_.Round(layer, first, n, target_.data() + offset);
          }
        }
      }
      StepPart(shape_.bias_offset(layer), shape_.vector_count(layer));
      if constexpr (std::is_same_v<Scalar, float>) {
        const Eigen::Index bias = shape_.bias_offset(layer);
        if (!rounded_.empty()) rounded_.CopyBias(layer, parameters_.data() + bias);
        if (!rounded_target_.empty()) rounded_target_.CopyBias(layer, target_.data() + bias);
      }
    }
  }
  void set_learning_rate(double learning_rate) { adam_.set_learning_rate(learning_rate); }
  // The share of the online network that each of the next steps adds to the target, where there is one. It is
  // 0 in a new network.
  void set_target_tau(double tau) { target_tau_ = static_cast<Scalar>(tau); }

  void Save(const std::string& name, TensorFile* file) const {
    TrainedNetwork& self = const_cast<TrainedNetwork&>(*this);
    self.Visit(name, [&](const std::string& key, VectorX<Scalar>& values) { PutTensor(key, values, file); });
    PutCounter(name + ".adam.steps", adam_.steps(), file);
  }
  // Returns DataLoss where a tensor or counter is missing and InvalidArgument where a tensor has another
  // size.
  absl::Status Load(const std::string& name, const TensorFile& file) {
    return LoadParts(name, file, /*starts_target=*/false);
  }
  // As Load, but takes a file without the target: the target then starts from the online network. Requires a
  // target.
  absl::Status LoadOrStartTarget(const std::string& name, const TensorFile& file) {
    return LoadParts(name, file, /*starts_target=*/file.tensors.count(TargetName(name)) == 0);
  }

 private:
  // How many parameters a step takes through all its parts at once: they stay in the first-level cache.
  static constexpr Eigen::Index kGroupEntries = 512;

  static MlpParameters<Scalar> Parameters(const VectorX<Scalar>& values, const RoundedWeights& rounded) {
    return {values.data(), rounded.empty() ? nullptr : &rounded};
  }
  bool moves_target() const { return target_.size() > 0 && target_tau_ > 0; }
  // One step of entries first ... first + n, and of the target.
  void StepPart(Eigen::Index first, Eigen::Index n) {
    adam_.StepPart(gradient_.data(), first, n, parameters_.data());
    if (!moves_target()) return;
    auto target = target_.segment(first, n);
    target += target_tau_ * (parameters_.segment(first, n) - target);
  }
  void RoundAll() {
    if constexpr (std::is_same_v<Scalar, float>) {
      if (!rounded_.empty()) rounded_.RoundAll(shape_, parameters_.data());
      if (!rounded_target_.empty()) rounded_target_.RoundAll(shape_, target_.data());
    }
  }

  absl::Status LoadParts(const std::string& name, const TensorFile& file, bool starts_target) {
    absl::Status status;
    Visit(name, [&](const std::string& key, VectorX<Scalar>& values) {
      if (starts_target && &values == &target_) return;
      status.Update(GetTensor(key, file, &values));
    });
    std::uint64_t steps = 0;
    status.Update(GetCounter(name + ".adam.steps", file, &steps));
    adam_.set_steps(steps);
    if (starts_target) target_ = parameters_;
    RoundAll();
    return status;
  }

  static std::string TargetName(const std::string& name) { return name + ".target"; }
  template <class Function>
  void Visit(const std::string& name, const Function& function) {
    function(name, parameters_);
    if (target_.size() > 0) function(TargetName(name), target_);
    function(name + ".adam.first", adam_.first_moment());
    function(name + ".adam.second", adam_.second_moment());
  }

  MlpShape shape_;
  VectorX<Scalar> parameters_;
  VectorX<Scalar> target_;
  RoundedWeights rounded_, rounded_target_;  // empty unless products are made in bfloat16
  Scalar target_tau_ = 0;
  Adam<Scalar> adam_;
  VectorX<Scalar> gradient_;
  MlpActivations<Scalar> activations_;
  MlpActivations<Scalar> target_activations_;
  MlpActivations<Scalar> input_activations_;
};

}  // namespace dbr
