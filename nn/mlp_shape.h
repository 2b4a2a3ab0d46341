// The sizes of a multi-layer perceptron.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dbr {

// Sizes of the layers, and where each layer's parameters lie in the flat vector: for each layer in turn its
// weight [out x in], column-major, then its bias [out] and, where the layer is normalised (nn/layer_norm.h),
// its gain [out] and its shift [out].
class MlpShape {
 public:
  MlpShape() = default;
  // `layer_norm`: whether the hidden layers are normalised.
  MlpShape(int input_size, const std::vector<int>& hidden_sizes, int output_size, bool layer_norm = false);

  int layer_count() const { return static_cast<int>(sizes_.size()) - 1; }
  int input_size() const { return sizes_.front(); }
  int output_size() const { return sizes_.back(); }
  int in(int layer) const { return sizes_[layer]; }
  int out(int layer) const { return sizes_[layer + 1]; }
  bool layer_norm() const { return layer_norm_; }
  Eigen::Index weight_offset(int layer) const { return offsets_[layer]; }
  Eigen::Index bias_offset(int layer) const { return offsets_[layer] + Eigen::Index{in(layer)} * out(layer); }
  // Of normalised layers alone.
  Eigen::Index gain_offset(int layer) const { return bias_offset(layer) + out(layer); }
  Eigen::Index shift_offset(int layer) const { return gain_offset(layer) + out(layer); }
  // How many parameters a layer has after its weight, from its bias on.
  Eigen::Index vector_count(int layer) const { return offsets_[layer + 1] - bias_offset(layer); }
  Eigen::Index parameter_count() const { return offsets_.back(); }

  // Useful floating-point operations of the matrix products for n samples: 2 m n k each. Those of the
  // gradient are the weight gradients and the deltas of all layers but the input.
  double ForwardFlops(Eigen::Index n) const;
  double ParameterGradientFlops(Eigen::Index n) const;

  bool operator==(const MlpShape& other) const {
    return sizes_ == other.sizes_ && layer_norm_ == other.layer_norm_;
  }

 private:
  bool layer_norm_ = false;
  std::vector<int> sizes_;             // of the input, then of each layer's output
  std::vector<Eigen::Index> offsets_;  // of each layer's weight, then of the vector's end
};

}  // namespace dbr
