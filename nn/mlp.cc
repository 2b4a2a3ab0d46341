#include "nn/mlp.h"

#include <cmath>

#include "core/check.h"

namespace dbr {
namespace {

template <class Scalar>
using WeightMap = Eigen::Map<const MatrixX<Scalar>>;

template <class Scalar>
WeightMap<Scalar> Weight(const MlpShape& shape, const Scalar* parameters, int layer) {
  return {parameters + shape.weight_offset(layer), shape.out(layer), shape.in(layer)};
}

// Adds the bias to each column and clips at zero where `relu`, in one pass.
template <class Scalar>
void AddBias(const Scalar* bias, bool relu, MatrixX<Scalar>* y) {
  const Eigen::Map<const VectorX<Scalar>> b(bias, y->rows());
  for (Eigen::Index j = 0; j < y->cols(); ++j) {
    if (relu) {
      y->col(j) = (y->col(j) + b).cwiseMax(Scalar{0});
    } else {
      y->col(j) += b;
    }
  }
}

// The delta of a layer's input: W^T delta, zero where that input was clipped.
template <class Scalar, class Delta>
void PropagateDelta(const MlpShape& shape, const Scalar* parameters, int layer, const Delta& delta,
                    MlpActivations<Scalar>* activations) {
  MatrixX<Scalar>& previous = activations->deltas[layer - 1];
  const MatrixX<Scalar>& input = activations->outputs[layer - 1];
  previous.resize(shape.in(layer), delta.cols());
  previous.noalias() = Weight(shape, parameters, layer).transpose() * delta;
  previous.array() = (input.array() > Scalar{0}).select(previous.array(), Scalar{0});
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
  for (int layer = 0; layer < layers; ++layer) {
    MatrixX<Scalar>& y = activations->outputs[layer];
    y.resize(shape.out(layer), x.cols());
    if (layer == 0) {
      y.noalias() = Weight(shape, parameters, layer) * x;
    } else {
      y.noalias() = Weight(shape, parameters, layer) * activations->outputs[layer - 1];
    }
    AddBias(parameters + shape.bias_offset(layer), layer + 1 < layers, &y);
  }
  return activations->outputs.back();
}

template <class Scalar>
void MlpParameterGradient(const MlpShape& shape, const Scalar* parameters, const ConstMatrixRef<Scalar>& x,
                          const ConstMatrixRef<Scalar>& dy, MlpActivations<Scalar>* activations,
                          VectorX<Scalar>* gradient) {
  const int layers = shape.layer_count();
  DBR_CHECK(dy.rows() == shape.output_size() && dy.cols() == x.cols());
  gradient->resize(shape.parameter_count());
  activations->deltas.resize(layers - 1);
  const auto layer_gradient = [&](int layer, const auto& delta, const auto& input) {
    Eigen::Map<MatrixX<Scalar>> weight(gradient->data() + shape.weight_offset(layer), shape.out(layer),
                                       shape.in(layer));
    Eigen::Map<VectorX<Scalar>> bias(gradient->data() + shape.bias_offset(layer), shape.out(layer));
    weight.noalias() = delta * input.transpose();
    bias = delta.col(0);
    for (Eigen::Index j = 1; j < delta.cols(); ++j) bias += delta.col(j);
  };
  const auto visit = [&](int layer, const auto& delta) {
    if (layer == 0) {
      layer_gradient(layer, delta, x);
    } else {
      layer_gradient(layer, delta, activations->outputs[layer - 1]);
      PropagateDelta(shape, parameters, layer, delta, activations);
    }
  };
  visit(layers - 1, dy);
  for (int layer = layers - 2; layer >= 0; --layer) visit(layer, activations->deltas[layer]);
}

template <class Scalar>
void MlpInputGradient(const MlpShape& shape, const Scalar* parameters, const ConstMatrixRef<Scalar>& dy,
                      MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx) {
  const int layers = shape.layer_count();
  activations->deltas.resize(layers - 1);
  dx->resize(shape.input_size(), dy.cols());
  if (layers == 1) {
    dx->noalias() = Weight(shape, parameters, 0).transpose() * dy;
    return;
  }
  PropagateDelta(shape, parameters, layers - 1, dy, activations);
  for (int layer = layers - 2; layer > 0; --layer) {
    PropagateDelta(shape, parameters, layer, activations->deltas[layer], activations);
  }
  dx->noalias() = Weight(shape, parameters, 0).transpose() * activations->deltas[0];
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
  template VectorX<Scalar> InitialParameters<Scalar>(const MlpShape&, Rng&);                                \
  template void PolyakUpdate<Scalar>(const VectorX<Scalar>&, Scalar, VectorX<Scalar>*);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
