// The passes of a multi-layer perceptron through its layers, forward and backward, with products of one kind
// of element.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/batch.h"
#include "nn/layer_norm.h"
#include "nn/mlp_parameters.h"
#include "nn/mlp_shape.h"
#include "nn/product/layer_products.h"

namespace dbr {

template <class Scalar>
using ConstMatrixRef = Eigen::Ref<const MatrixX<Scalar>>;

// What a forward pass leaves for its backward passes, and the products of each layer: reused from batch to
// batch, for one network shape after the other. The elements are float, double or Bfloat16; with Bfloat16 all
// products take rounded numbers and sum them in float32, and what comes in and goes out is float32. It can be
// moved. One thread at a time. The functions are those of nn/mlp.h.
template <class Element>
class MlpPass {
 public:
  using Sum = SumOf<Element>;
  using Parameters = MlpParameters<Sum>;

  const MatrixX<Sum>& Forward(const MlpShape& shape, const Parameters& parameters,
                              const ConstMatrixRef<Sum>& x);
  void ParameterGradient(const Parameters& parameters, const ConstMatrixRef<Sum>& x,
                         const ConstMatrixRef<Sum>& dy, VectorX<Sum>* gradient);
  void InputGradient(const Parameters& parameters, const ConstMatrixRef<Sum>& dy, Eigen::Index rows,
                     MatrixX<Sum>* dx);
  void InputGradientOfDeltas(const Parameters& parameters, const ConstMatrixRef<Sum>& dy, MatrixX<Sum>* dx);

 private:
  // Columns that go through all layers before the next ones come: what they leave in each layer stays in the
  // second-level cache.
  static constexpr Eigen::Index kBlockColumns = 256;
  // The number of samples with a gradient changes from batch to batch. It is rounded up to a multiple of this
  // with samples whose gradient is 0, so that products come in few shapes.
  static constexpr Eigen::Index kColumnGroup = 32;

  // The samples of a block whose output has a gradient at all: where a loss takes the smaller of two
  // networks' values, that is half of them.
  struct ActiveSamples {
    std::array<Eigen::Index, kBlockColumns> columns;  // in rising order, from the block's first
    Eigen::Index count = 0;
  };

  void SetShape(const MlpShape& shape);
  void ResizeDeltas(Eigen::Index n);
  LayerParameters<Element> Layer(const Parameters& parameters, int layer) const;
  LayerNormParameters<Sum> Norm(const Parameters& parameters, int layer) const;
  // The output of a hidden layer for samples first ... first + from.cols, into hidden_.
  Columns<const Element> HiddenForward(const Parameters& parameters, int layer, Columns<const Element> from,
                                       Eigen::Index first);
  // Turns `delta`, the gradient at a hidden layer's output for the sample in column `sample` of hidden_, into
  // that at its W x + b, in place, and adds to the layer's part of `gradient` [parameter_count] but its
  // weight's, unless it is null.
  void HiddenBackward(const Parameters& parameters, int layer, Eigen::Index sample, Element* delta,
                      Sum* gradient);
  // The network's input as products take it: x itself, or rounded into input_ where `fresh`.
  Columns<const Element> Input(const ConstMatrixRef<Sum>& x, bool fresh);
  // The gradient at the output as products take it: columns of dy itself, or rounded into d_output_.
  Columns<const Element> OutputDelta(const Columns<const Sum>& dy);
  // The columns of dy [out x n] that are not 0, side by side in active_dy_, and zeros up to a multiple of
  // kColumnGroup, but at most n.
  Eigen::Index GatherActive(const ConstMatrixRef<Sum>& dy, Eigen::Index first, Eigen::Index n);
  // Sends the deltas of columns first ... of the block back through all layers, into dx: the gradient at the
  // last dx.rows inputs.
  void Backpropagate(const Parameters& parameters, Columns<const Element> delta, Eigen::Index first,
                     Columns<Sum> dx);
  // Moves the first active_.count columns of dx to where they belong, in place; the others become zero.
  void Scatter(Columns<Sum> dx) const;
  // Makes the products for every number of active samples of a block of n.
  void PrepareInputGradient(const Parameters& parameters, Eigen::Index n, Columns<Sum> dx);

  MlpShape shape_;
  std::vector<std::unique_ptr<LayerProducts<Element>>> products_;  // of each layer
  // Some have more columns than the newest batch.
  std::vector<MatrixX<Element>> hidden_;   // [out x n] each hidden layer's output after its ReLU, padded
  std::vector<MatrixX<Element>> deltas_;   // [in x n] the gradient at each layer's input but the first's
  std::vector<LayerNorm<Element>> norms_;  // of each hidden layer, where they are normalised
  MatrixX<Element> input_, d_output_;      // [in x n], [out x n] rounded and padded, for Bfloat16
  MatrixX<Sum> output_;                    // [out x n]
  MatrixX<Sum> active_dy_;                 // [out x kBlockColumns] the columns of dy that are not 0
  ActiveSamples active_;
  Eigen::Index prepared_columns_ = 0;  // of the largest block that PrepareInputGradient was called for
};

}  // namespace dbr
