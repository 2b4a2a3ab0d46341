#include "nn/rounded_weights.h"

#include <algorithm>

namespace dbr {

RoundedWeights::RoundedWeights(const MlpShape& shape) {
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    weights_.push_back(MatrixX<Bfloat16>::Zero(PaddedRows<Bfloat16>(shape.out(layer)),
                                               PaddedRows<Bfloat16>(shape.in(layer))));
    biases_.push_back(VectorX<float>::Zero(PaddedRows<Bfloat16>(shape.out(layer))));
    outputs_.push_back(shape.out(layer));
  }
}

void RoundedWeights::Round(int layer, Eigen::Index first, Eigen::Index n, const float* column) {
  const Eigen::Index rows = outputs_[layer];
  for (Eigen::Index j = 0; j < n; ++j) {
    RoundToBfloat16(column + j * rows, rows, weights_[layer].col(first + j).data());
  }
}

void RoundedWeights::CopyBias(int layer, const float* bias) {
  std::copy_n(bias, outputs_[layer], biases_[layer].data());
}

void RoundedWeights::RoundAll(const MlpShape& shape, const float* parameters) {
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    Round(layer, 0, shape.in(layer), parameters + shape.weight_offset(layer));
    CopyBias(layer, parameters + shape.bias_offset(layer));
  }
}

}  // namespace dbr
