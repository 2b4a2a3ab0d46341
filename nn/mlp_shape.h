// The sizes of a multi-layer perceptron.
#pragma once

#include <Eigen/Core>
#include <vector>

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

  bool operator==(const MlpShape& other) const { return sizes_ == other.sizes_; }

 private:
  std::vector<int> sizes_;             // of the input, then of each layer's output
  std::vector<Eigen::Index> offsets_;  // of each layer's weight, then of the vector's end
};

}  // namespace dbr
