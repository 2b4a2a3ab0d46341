// A network's weights in bfloat16, as its products read them.
#pragma once

#include <vector>

#include "core/batch.h"
#include "nn/mlp_shape.h"
#include "nn/product/bfloat16.h"

namespace dbr {

// A rounded copy of the weights of a flat parameter vector, whose owner refreshes it when they change. The
// biases are copied without rounding: products take them in float32. Each weight is padded with rows and
// columns of zeros, and each bias with zeros (PaddedRows). It can be copied.
class RoundedWeights {
 public:
  RoundedWeights() = default;  // of no network
  explicit RoundedWeights(const MlpShape& shape);

  bool empty() const { return weights_.empty(); }

  // Rounds columns first ... first + n of a layer's weight from `column` on, [out x n], where they lie in the
  // parameters side by side.
  void Round(int layer, Eigen::Index first, Eigen::Index n, const float* column);
  // Takes over a layer's bias [out].
  void CopyBias(int layer, const float* bias);
  // Rounds all weights of `parameters` [parameter_count] and takes over the biases.
  void RoundAll(const MlpShape& shape, const float* parameters);

  // [PaddedRows(out) x PaddedRows(in)], column-major.
  const MatrixX<Bfloat16>& weight(int layer) const { return weights_[layer]; }
  // [PaddedRows(out)].
  const VectorX<float>& bias(int layer) const { return biases_[layer]; }

 private:
  std::vector<MatrixX<Bfloat16>> weights_;
  std::vector<VectorX<float>> biases_;
  std::vector<Eigen::Index> outputs_;  // of each layer, without padding
};

}  // namespace dbr
