#include "nn/mlp_shape.h"

#include "core/check.h"

namespace dbr {

MlpShape::MlpShape(int input_size, const std::vector<int>& hidden_sizes, int output_size, bool layer_norm)
    : layer_norm_(layer_norm) {
  sizes_.push_back(input_size);
  sizes_.insert(sizes_.end(), hidden_sizes.begin(), hidden_sizes.end());
  sizes_.push_back(output_size);
  offsets_.push_back(0);
  for (int layer = 0; layer < layer_count(); ++layer) {
    DBR_CHECK(in(layer) > 0 && out(layer) > 0);
    const bool normalized = layer_norm && layer + 1 < layer_count();
    const int vectors = normalized ? 3 : 1;  // bias, gain, shift
    offsets_.push_back(offsets_.back() + Eigen::Index{in(layer) + vectors} * out(layer));
  }
}

double MlpShape::ForwardFlops(Eigen::Index n) const {
  double products = 0;
  for (int layer = 0; layer < layer_count(); ++layer) products += static_cast<double>(in(layer)) * out(layer);
  return 2.0 * static_cast<double>(n) * products;
}

double MlpShape::ParameterGradientFlops(Eigen::Index n) const {
  const double first_layer = 2.0 * static_cast<double>(n) * in(0) * out(0);
  return 2.0 * ForwardFlops(n) - first_layer;
}

}  // namespace dbr
