// A multi-layer perceptron with ReLU hidden layers, normalised or not (MlpShape), whose parameters are ONE
// flat vector.
#pragma once

#include <Eigen/Core>

#include "core/batch.h"
#include "core/rng.h"
#include "nn/mlp_parameters.h"
#include "nn/mlp_pass.h"
#include "nn/mlp_shape.h"

namespace dbr {

// What a forward pass leaves for its backward pass, and what its products need; owned by the caller, reused
// from batch to batch. It can be moved.
template <class Scalar>
struct MlpActivations {
  MlpPass<Scalar> full;  // products in Scalar's own precision
};
template <>
struct MlpActivations<float> {
  MlpPass<float> full;
  MlpPass<Bfloat16> reduced;  // of networks with rounded weights
};

// y = f(x), [output x n] from x [input x n]; the result lies in `activations`, valid until its next use.
template <class Scalar>
const MatrixX<Scalar>& MlpForward(const MlpShape& shape, const MlpParameters<Scalar>& parameters,
                                  const ConstMatrixRef<Scalar>& x, MlpActivations<Scalar>* activations);
template <class Scalar>
const MatrixX<Scalar>& MlpForward(const MlpShape& shape, const Scalar* parameters,
                                  const ConstMatrixRef<Scalar>& x, MlpActivations<Scalar>* activations) {
  return MlpForward<Scalar>(shape, MlpParameters<Scalar>(parameters), x, activations);
}

// The gradient of sum(dy .* y) with respect to the parameters, overwriting `gradient` [parameter_count], for
// the x and activations of a forward pass with the same parameters. The input's gradient is not computed.
template <class Scalar>
void MlpParameterGradient(const MlpParameters<Scalar>& parameters, const ConstMatrixRef<Scalar>& x,
                          const ConstMatrixRef<Scalar>& dy, MlpActivations<Scalar>* activations,
                          VectorX<Scalar>* gradient);

// The gradient of sum(dy .* y) with respect to the last `rows` rows of x, [rows x n], without the parameters'
// gradient, for the activations of a forward pass with the same parameters. A sample whose column of dy is
// zero costs nothing.
template <class Scalar>
void MlpInputGradient(const MlpParameters<Scalar>& parameters, const ConstMatrixRef<Scalar>& dy,
                      Eigen::Index rows, MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx);

// The gradient with respect to all rows of x straight after MlpParameterGradient for the same dy, from the
// deltas that it left: one product.
template <class Scalar>
void MlpInputGradientOfDeltas(const MlpParameters<Scalar>& parameters, const ConstMatrixRef<Scalar>& dy,
                              MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx);

// Weights and biases uniform in +-1/sqrt(fan-in), as PyTorch's linear layers start; gains 1 and shifts 0.
template <class Scalar>
VectorX<Scalar> InitialParameters(const MlpShape& shape, Rng& rng);

}  // namespace dbr
