// A multi-layer perceptron with ReLU hidden layers whose parameters are ONE flat vector.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/batch.h"
#include "core/rng.h"

namespace dbr {

// Sizes of the layers, and where each layer's parameters lie in the flat vector: for each layer in turn its
// weight [out x in], column-major, then its bias [out].
class MlpShape {
 public:
  MlpShape() = default;
  MlpShape(int input_size, const std::vector<int>& hidden_sizes, int output_size);

  int layer_count() const { return static_cast<int>(sizes_.size()) - 1; }
  int input_size() const { return sizes_.front(); }
  int output_size() const { return sizes_.back(); }
  int in(int layer) const { return sizes_[layer]; }
  int out(int layer) const { return sizes_[layer + 1]; }
  Eigen::Index weight_offset(int layer) const { return offsets_[layer]; }
  Eigen::Index bias_offset(int layer) const { return offsets_[layer] + Eigen::Index{in(layer)} * out(layer); }
  Eigen::Index parameter_count() const { return offsets_.back(); }

  // Useful floating-point operations of the matrix products for n samples: 2 m n k each. Those of the
  // gradient are the weight gradients and the deltas of all layers but the input.
  double ForwardFlops(Eigen::Index n) const;
  double ParameterGradientFlops(Eigen::Index n) const;

 private:
  std::vector<int> sizes_;             // of the input, then of each layer's output
  std::vector<Eigen::Index> offsets_;  // of each layer's weight, then of the vector's end
};

// What a forward pass leaves for its backward pass; owned by the caller, reused from batch to batch.
template <class Scalar>
struct MlpActivations {
  std::vector<MatrixX<Scalar>> outputs;  // [out x n] each layer's output after its ReLU (the last has none)
  std::vector<MatrixX<Scalar>> deltas;   // [in x n] the gradient at each layer's input but the first's
  MatrixX<Scalar> active_dy;             // workspace of MlpInputGradient: the columns of dy that are not 0
};

template <class Scalar>
using ConstMatrixRef = Eigen::Ref<const MatrixX<Scalar>>;

// y = f(x), [output x n] from x [input x n]; the result lies in `activations`, valid until its next use.
template <class Scalar>
const MatrixX<Scalar>& MlpForward(const MlpShape& shape, const Scalar* parameters,
                                  const ConstMatrixRef<Scalar>& x, MlpActivations<Scalar>* activations);

// The gradient of sum(dy .* y) with respect to the parameters, overwriting `gradient` [parameter_count], for
// the x and activations of a forward pass with the same parameters. The input's gradient is not computed.
template <class Scalar>
void MlpParameterGradient(const MlpShape& shape, const Scalar* parameters, const ConstMatrixRef<Scalar>& x,
                          const ConstMatrixRef<Scalar>& dy, MlpActivations<Scalar>* activations,
                          VectorX<Scalar>* gradient);

// The gradient of sum(dy .* y) with respect to x, [input x n], without the parameters' gradient. A sample
// whose column of dy is zero costs nothing.
template <class Scalar>
void MlpInputGradient(const MlpShape& shape, const Scalar* parameters, const ConstMatrixRef<Scalar>& dy,
                      MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx);

// The same straight after MlpParameterGradient for the same dy, from the deltas that it left: one product.
template <class Scalar>
void MlpInputGradientOfDeltas(const MlpShape& shape, const Scalar* parameters,
                              const ConstMatrixRef<Scalar>& dy, const MlpActivations<Scalar>& activations,
                              MatrixX<Scalar>* dx);

// Weights and biases uniform in +-1/sqrt(fan-in), as PyTorch's linear layers start.
template <class Scalar>
VectorX<Scalar> InitialParameters(const MlpShape& shape, Rng& rng);

// target <- (1 - tau) * target + tau * online (Polyak averaging).
template <class Scalar>
void PolyakUpdate(const VectorX<Scalar>& online, Scalar tau, VectorX<Scalar>* target);

}  // namespace dbr
