// Layer normalisation of a hidden layer, with the ReLU that follows it, forward and backward.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/batch.h"
#include "nn/product/layer_products.h"

namespace dbr {

// What is trained of a layer's normalisation: gain and shift [units]. Owns nothing.
template <class Scalar>
struct LayerNormParameters {
  const Scalar* gain;
  const Scalar* shift;
};

// Where the backward pass adds up the gradients of a layer's bias, gain and shift [units]. Owns nothing.
template <class Scalar>
struct LayerNormGradient {
  Scalar* bias;
  Scalar* gain;
  Scalar* shift;
};

// For each sample y = relu(gain .* (z - mean(z)) / sqrt(var(z) + 1e-5) + shift), where mean and (biased)
// variance are those of z = W x + b over the layer's units (Ba, Kiros, Hinton 2016, "Layer Normalization").
//
// Holds what the forward pass of one layer leaves for its backward passes, reused from batch to batch. All
// is computed in SumOf<Element>; y and delta are Elements. Matrices may be padded (PaddedRows): rows that
// were added take no part, and those of y and delta stay as they are. It can be moved. One thread at a time.
template <class Element>
class LayerNorm {
 public:
  using Sum = SumOf<Element>;

  // Makes room for n samples. Allocates nothing where there is room.
  void Resize(Eigen::Index units, Eigen::Index n);

  // Where z [PaddedRows(units) x n] of samples first ... first + n goes, before Forward.
  Columns<Sum> Sums(Eigen::Index first, Eigen::Index n);
  // Sets y [units x n] of samples first ... first + n from their z. A NaN in z makes its whole sample NaN.
  void Forward(const LayerNormParameters<Sum>& parameters, Eigen::Index first, const Columns<Element>& y);
  // Turns the gradient at a sample's y [units] into that at its z, in place, and adds to `gradient` unless it
  // is null. `sample` and `y` are those of the newest Forward.
  void Backward(const LayerNormParameters<Sum>& parameters, Eigen::Index sample, const Element* y,
                Element* delta, const LayerNormGradient<Sum>* gradient);

 private:
  struct Statistics {
    Sum mean;
    Sum inverse_deviation;  // 1 / sqrt(var + 1e-5)
  };

  template <bool kAdds>
  void BackwardOf(const LayerNormParameters<Sum>& parameters, Eigen::Index sample, const Element* y,
                  Element* delta, const LayerNormGradient<Sum>& gradient);

  Eigen::Index units_ = 0;
  MatrixX<Sum> z_;                      // [PaddedRows(units) x n]
  std::vector<Statistics> statistics_;  // [n]
  VectorX<Sum> columns_;                // [2 units] of the sample at work
};

}  // namespace dbr
