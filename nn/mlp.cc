#include "nn/mlp.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "nn/product/blas_product.h"

namespace dbr {
namespace {

// Columns that go through all layers before the next ones come: what they leave in each layer stays in the
// second-level cache.
constexpr Eigen::Index kBlockColumns = 256;

// Adds the bias to each of n columns of y [rows x n] and clips at zero where `relu`, in one pass. A NaN stays
// one (nn/keep_nan.h).
template <class Scalar>
void AddBias(const Scalar* bias, bool relu, Eigen::Map<MatrixX<Scalar>> y) {
  const Eigen::Map<const VectorX<Scalar>> b(bias, y.rows());
  for (Eigen::Index j = 0; j < y.cols(); ++j) {
    if (relu) {
      y.col(j) = (y.col(j) + b).cwiseMax(Scalar{0});
    } else {
      y.col(j) += b;
    }
  }
}

// Columns first ... first + n of `matrix`, in place.
template <class Scalar>
Eigen::Map<MatrixX<Scalar>> Columns(MatrixX<Scalar>* matrix, Eigen::Index first, Eigen::Index n) {
  return {matrix->data() + first * matrix->rows(), matrix->rows(), n};
}
template <class Scalar>
Operand<Scalar> ColumnsOf(const ConstMatrixRef<Scalar>& matrix, Eigen::Index first, Eigen::Index n) {
  return {matrix.data() + first * matrix.outerStride(), matrix.rows(), n, matrix.outerStride()};
}

template <class Scalar>
Operand<Scalar> Weight(const MlpShape& shape, const Scalar* parameters, int layer) {
  return {parameters + shape.weight_offset(layer), shape.out(layer), shape.in(layer), shape.out(layer)};
}

// The delta of a layer's input: W^T delta [out x n], zero where that input was clipped, into the columns from
// `first` on. Column j of delta belongs to sample sample_of(j).
template <class Scalar, class SampleOf>
void PropagateDelta(const MlpShape& shape, const Scalar* parameters, int layer, const Operand<Scalar>& delta,
                    Eigen::Index first, const SampleOf& sample_of, MlpActivations<Scalar>* activations) {
  auto previous = Columns(&activations->deltas[layer - 1], first, delta.cols);
  Product(Transposed(Weight(shape, parameters, layer)), delta, previous.data(), previous.rows());
  const MatrixX<Scalar>& input = activations->outputs[layer - 1];
  for (Eigen::Index j = 0; j < delta.cols; ++j) {
    auto column = previous.col(j).array();
    column = (input.col(sample_of(j)).array() > Scalar{0}).select(column, Scalar{0});
  }
}

// The samples of a block whose output has a gradient at all: where a loss takes the smaller of two networks'
// values, that is half of them.
struct ActiveSamples {
  std::array<Eigen::Index, kBlockColumns> columns;  // in rising order, from the block's first
  Eigen::Index count = 0;
};

// Those of columns first ... first + n of dy, and their columns side by side into `gathered`.
template <class Scalar>
ActiveSamples GatherActive(const ConstMatrixRef<Scalar>& dy, Eigen::Index first, Eigen::Index n,
                           MatrixX<Scalar>* gathered) {
  ActiveSamples active;
  gathered->resize(dy.rows(), kBlockColumns);
  for (Eigen::Index j = 0; j < n; ++j) {
    if ((dy.col(first + j).array() == Scalar{0}).all()) continue;
    gathered->col(active.count) = dy.col(first + j);
    active.columns[active.count++] = j;
  }
  return active;
}

// Moves the first active.count columns of dx to where they belong, in place; the others become zero.
template <class Scalar>
void Scatter(const ActiveSamples& active, Eigen::Map<MatrixX<Scalar>> dx) {
  Eigen::Index left = active.count;
  for (Eigen::Index j = dx.cols() - 1; j >= left; --j) {
    if (left > 0 && active.columns[left - 1] == j) {
      dx.col(j) = dx.col(--left);
    } else {
      dx.col(j).setZero();
    }
  }
}

template <class Scalar>
void ResizeDeltas(const MlpShape& shape, Eigen::Index n, MlpActivations<Scalar>* activations) {
  activations->deltas.resize(shape.layer_count() - 1);
  for (int layer = 1; layer < shape.layer_count(); ++layer)
    activations->deltas[layer - 1].resize(shape.in(layer), n);
}

}  // namespace

MlpShape::MlpShape(int input_size, const std::vector<int>& hidden_sizes, int output_size) {
  sizes_.push_back(input_size);
  sizes_.insert(sizes_.end(), hidden_sizes.begin(), hidden_sizes.end());
  sizes_.push_back(output_size);
  offsets_.push_back(0);
  for (int layer = 0; layer < layer_count(); ++layer) {
    DBR_CHECK(in(layer) > 0 && out(layer) > 0);
    offsets_.push_back(offsets_.back() + Eigen::Index{in(layer) + 1} * out(layer));
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

template <class Scalar>
const MatrixX<Scalar>& MlpForward(const MlpShape& shape, const Scalar* parameters,
                                  const ConstMatrixRef<Scalar>& x, MlpActivations<Scalar>* activations) {
  DBR_CHECK(x.rows() == shape.input_size());
  const int layers = shape.layer_count();
  activations->outputs.resize(layers);
  for (int layer = 0; layer < layers; ++layer) activations->outputs[layer].resize(shape.out(layer), x.cols());
  for (Eigen::Index first = 0; first < x.cols(); first += kBlockColumns) {
    const Eigen::Index n = std::min(kBlockColumns, x.cols() - first);
    Operand<Scalar> input = ColumnsOf(x, first, n);
    for (int layer = 0; layer < layers; ++layer) {
      auto y = Columns(&activations->outputs[layer], first, n);
      Product(Weight(shape, parameters, layer), input, y.data(), y.rows());
      AddBias<Scalar>(parameters + shape.bias_offset(layer), layer + 1 < layers, y);
      input = {y.data(), y.rows(), n, y.rows()};
    }
  }
  return activations->outputs.back();
}

template <class Scalar>
void MlpParameterGradient(const MlpShape& shape, const Scalar* parameters, const ConstMatrixRef<Scalar>& x,
                          const ConstMatrixRef<Scalar>& dy, MlpActivations<Scalar>* activations,
                          VectorX<Scalar>* gradient) {
  const Eigen::Index n = x.cols();
  DBR_CHECK(dy.rows() == shape.output_size() && dy.cols() == n);
  gradient->resize(shape.parameter_count());
  ResizeDeltas(shape, n, activations);
  Operand<Scalar> delta = ColumnsOf(dy, 0, n);
  for (int layer = shape.layer_count() - 1; layer >= 0; --layer) {
    const Operand<Scalar> input =
        layer == 0 ? ColumnsOf(x, 0, n) : ColumnsOf<Scalar>(activations->outputs[layer - 1], 0, n);
    Product(delta, Transposed(input), gradient->data() + shape.weight_offset(layer), shape.out(layer));
    Eigen::Map<VectorX<Scalar>> bias(gradient->data() + shape.bias_offset(layer), shape.out(layer));
    bias.setZero();
    for (Eigen::Index j = 0; j < n; ++j) {
      bias += Eigen::Map<const VectorX<Scalar>>(delta.values + j * delta.stride, delta.rows);
    }
    if (layer == 0) break;
    PropagateDelta(
        shape, parameters, layer, delta, 0, [](Eigen::Index j) { return j; }, activations);
    delta = ColumnsOf<Scalar>(activations->deltas[layer - 1], 0, n);
  }
}

template <class Scalar>
void MlpInputGradient(const MlpShape& shape, const Scalar* parameters, const ConstMatrixRef<Scalar>& dy,
                      MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx) {
  ResizeDeltas(shape, dy.cols(), activations);
  dx->resize(shape.input_size(), dy.cols());
  for (Eigen::Index first = 0; first < dy.cols(); first += kBlockColumns) {
    const Eigen::Index n = std::min(kBlockColumns, dy.cols() - first);
    const ActiveSamples active = GatherActive(dy, first, n, &activations->active_dy);
    auto block = Columns(dx, first, n);
    if (active.count > 0) {
      const auto sample_of = [&](Eigen::Index j) { return first + active.columns[j]; };
      Operand<Scalar> delta = ColumnsOf<Scalar>(activations->active_dy, 0, active.count);
      for (int layer = shape.layer_count() - 1; layer > 0; --layer) {
        PropagateDelta(shape, parameters, layer, delta, first, sample_of, activations);
        delta = ColumnsOf<Scalar>(activations->deltas[layer - 1], first, active.count);
      }
      Product(Transposed(Weight(shape, parameters, 0)), delta, block.data(), block.rows());
    }
    Scatter(active, block);
  }
}

template <class Scalar>
void MlpInputGradientOfDeltas(const MlpShape& shape, const Scalar* parameters,
                              const ConstMatrixRef<Scalar>& dy, const MlpActivations<Scalar>& activations,
                              MatrixX<Scalar>* dx) {
  const Eigen::Index n = dy.cols();
  const Operand<Scalar> delta =
      shape.layer_count() == 1 ? ColumnsOf(dy, 0, n) : ColumnsOf<Scalar>(activations.deltas[0], 0, n);
  dx->resize(shape.input_size(), n);
  Product(Transposed(Weight(shape, parameters, 0)), delta, dx->data(), dx->rows());
}

template <class Scalar>
VectorX<Scalar> InitialParameters(const MlpShape& shape, Rng& rng) {
  VectorX<Scalar> parameters(shape.parameter_count());
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    const double bound = 1.0 / std::sqrt(static_cast<double>(shape.in(layer)));
    const Eigen::Index end =
        layer + 1 < shape.layer_count() ? shape.weight_offset(layer + 1) : shape.parameter_count();
    for (Eigen::Index i = shape.weight_offset(layer); i < end; ++i) {
      parameters[i] = static_cast<Scalar>(bound * (2.0 * rng.Uniform() - 1.0));
    }
  }
  return parameters;
}

template <class Scalar>
void PolyakUpdate(const VectorX<Scalar>& online, Scalar tau, VectorX<Scalar>* target) {
  *target += tau * (online - *target);
}

#define DBR_INSTANTIATE(Scalar)                                                                             \
  template const MatrixX<Scalar>& MlpForward<Scalar>(                                                       \
      const MlpShape&, const Scalar*, const ConstMatrixRef<Scalar>&, MlpActivations<Scalar>*);              \
  template void MlpParameterGradient<Scalar>(const MlpShape&, const Scalar*, const ConstMatrixRef<Scalar>&, \
                                             const ConstMatrixRef<Scalar>&, MlpActivations<Scalar>*,        \
                                             VectorX<Scalar>*);                                             \
  template void MlpInputGradient<Scalar>(const MlpShape&, const Scalar*, const ConstMatrixRef<Scalar>&,     \
                                         MlpActivations<Scalar>*, MatrixX<Scalar>*);                        \
  template void MlpInputGradientOfDeltas<Scalar>(const MlpShape&, const Scalar*,                            \
                                                 const ConstMatrixRef<Scalar>&,                             \
                                                 const MlpActivations<Scalar>&, MatrixX<Scalar>*);          \
  template VectorX<Scalar> InitialParameters<Scalar>(const MlpShape&, Rng&);                                \
  template void PolyakUpdate<Scalar>(const VectorX<Scalar>&, Scalar, VectorX<Scalar>*);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
