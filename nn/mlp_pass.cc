#include "nn/mlp_pass.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <type_traits>

#include "core/check.h"

namespace dbr {
namespace {

template <class Element>
inline constexpr bool kRounds = !std::is_same_v<Element, SumOf<Element>>;

// Gives `matrix` PaddedRows(rows) rows and n columns or more: the number of samples with a gradient changes
// from batch to batch. The rows that are added are 0, and stay so: products write 0 there.
template <class Element>
void ResizePadded(Eigen::Index rows, Eigen::Index n, MatrixX<Element>* matrix) {
  const Eigen::Index padded = PaddedRows<Element>(rows);
  if (matrix->rows() == padded && matrix->cols() >= n) return;
  matrix->resize(padded, n);
  if constexpr (kRounds<Element>) matrix->setZero();
}

template <class Element>
Columns<Element> ColumnsOf(MatrixX<Element>* matrix, Eigen::Index first, Eigen::Index n) {
  return {matrix->data() + first * matrix->rows(), matrix->rows(), n, matrix->rows()};
}
template <class Scalar>
Columns<const Scalar> ColumnsOf(const ConstMatrixRef<Scalar>& matrix, Eigen::Index first, Eigen::Index n) {
  return {matrix.data() + first * matrix.outerStride(), matrix.rows(), n, matrix.outerStride()};
}

// Rounds the columns of x into the first rows of `rounded`, whose other rows stay 0.
void RoundColumns(const Columns<const float>& x, MatrixX<Bfloat16>* rounded) {
  ResizePadded(x.rows, x.cols, rounded);
  for (Eigen::Index j = 0; j < x.cols; ++j) {
    RoundToBfloat16(x.values + j * x.stride, x.rows, rounded->col(j).data());
  }
}

// Sets a column of delta to 0 where the ReLU clipped its sample's output and, where `sum` is not null, adds
// the rest to it: the gradient of the layer's bias. One pass over memory.
template <class Scalar>
void MaskColumn(const Scalar* __restrict output, Scalar* __restrict delta, Eigen::Index rows,
                Scalar* __restrict sum) {
  if (sum == nullptr) {
    for (Eigen::Index i = 0; i < rows; ++i) delta[i] = output[i] > Scalar{0} ? delta[i] : Scalar{0};
    return;
  }
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Scalar kept = output[i] > Scalar{0} ? delta[i] : Scalar{0};
    delta[i] = kept;
    sum[i] += kept;
  }
}
void MaskColumn(const Bfloat16* output, Bfloat16* delta, Eigen::Index rows, float* __restrict sum) {
  // A number is above 0 where its bits, as a signed integer, are.
  const auto* const __restrict out = reinterpret_cast<const std::int16_t*>(output);
  auto* const __restrict d = reinterpret_cast<std::uint16_t*>(delta);
  if (sum == nullptr) {
    for (Eigen::Index i = 0; i < rows; ++i) d[i] = out[i] > 0 ? d[i] : std::uint16_t{0};
    return;
  }
  for (Eigen::Index i = 0; i < rows; ++i) {
    const std::uint16_t kept = out[i] > 0 ? d[i] : std::uint16_t{0};
    d[i] = kept;
    sum[i] += std::bit_cast<float>(std::uint32_t{kept} << 16);
  }
}

}  // namespace

template <class Element>
void MlpPass<Element>::SetShape(const MlpShape& shape) {
  if (shape == shape_) return;
  shape_ = shape;
  prepared_columns_ = 0;
  // What another shape left in rows that are padding now would not be 0.
  hidden_.clear();
  deltas_.clear();
  norms_.clear();
  if (shape.layer_norm()) norms_.resize(static_cast<std::size_t>(shape.layer_count() - 1));
  input_.resize(0, 0);
  d_output_.resize(0, 0);
  products_.clear();
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    products_.push_back(MakeLayerProducts<Element>({shape.in(layer), shape.out(layer)}));
  }
}

template <class Element>
void MlpPass<Element>::ResizeDeltas(Eigen::Index n) {
  deltas_.resize(static_cast<std::size_t>(shape_.layer_count() - 1));
  for (int layer = 1; layer < shape_.layer_count(); ++layer) {
    ResizePadded(shape_.in(layer), n, &deltas_[layer - 1]);
  }
}

template <class Element>
LayerParameters<Element> MlpPass<Element>::Layer(const Parameters& parameters, int layer) const {
  if constexpr (kRounds<Element>) {
    const MatrixX<Bfloat16>& weight = parameters.rounded->weight(layer);
    return {weight.data(), weight.rows(), parameters.rounded->bias(layer).data()};
  } else {
    return {parameters.values + shape_.weight_offset(layer), shape_.out(layer),
            parameters.values + shape_.bias_offset(layer)};
  }
}

template <class Element>
Columns<const Element> MlpPass<Element>::Input(const ConstMatrixRef<Sum>& x, bool fresh) {
  const Columns<const Sum> columns = ColumnsOf<Sum>(x, 0, x.cols());
  if constexpr (kRounds<Element>) {
    if (fresh) RoundColumns(columns, &input_);
    return ColumnsOf(&input_, 0, x.cols());
  } else {
    return columns;
  }
}

template <class Element>
Columns<const Element> MlpPass<Element>::OutputDelta(const Columns<const Sum>& dy) {
  if constexpr (kRounds<Element>) {
    RoundColumns(dy, &d_output_);
    return ColumnsOf(&d_output_, 0, dy.cols);
  } else {
    return dy;
  }
}

template <class Element>
LayerNormParameters<SumOf<Element>> MlpPass<Element>::Norm(const Parameters& parameters, int layer) const {
  return {parameters.values + shape_.gain_offset(layer), parameters.values + shape_.shift_offset(layer)};
}

template <class Element>
Columns<const Element> MlpPass<Element>::HiddenForward(const Parameters& parameters, int layer,
                                                       Columns<const Element> from, Eigen::Index first) {
  const Columns<Element> to = ColumnsOf(&hidden_[layer], first, from.cols);
  if (shape_.layer_norm()) {
    products_[layer]->Output(Layer(parameters, layer), from, norms_[layer].Sums(first, from.cols));
    norms_[layer].Forward(Norm(parameters, layer), first, to);
  } else {
    products_[layer]->Hidden(Layer(parameters, layer), from, to);
  }
  return to;
}

template <class Element>
void MlpPass<Element>::HiddenBackward(const Parameters& parameters, int layer, Eigen::Index sample,
                                      Element* delta, Sum* gradient) {
  const Element* const output = hidden_[layer].col(sample).data();
  Sum* const bias = gradient == nullptr ? nullptr : gradient + shape_.bias_offset(layer);
  if (!shape_.layer_norm()) return MaskColumn(output, delta, shape_.out(layer), bias);
  if (gradient == nullptr) {
    return norms_[layer].Backward(Norm(parameters, layer), sample, output, delta, nullptr);
  }
  const LayerNormGradient<Sum> sums{bias, gradient + shape_.gain_offset(layer),
                                    gradient + shape_.shift_offset(layer)};
  norms_[layer].Backward(Norm(parameters, layer), sample, output, delta, &sums);
}

template <class Element>
const MatrixX<SumOf<Element>>& MlpPass<Element>::Forward(const MlpShape& shape, const Parameters& parameters,
                                                         const ConstMatrixRef<Sum>& x) {
  DBR_CHECK(x.rows() == shape.input_size());
  SetShape(shape);
  const int last = shape.layer_count() - 1;
  hidden_.resize(static_cast<std::size_t>(last));
  for (int layer = 0; layer < last; ++layer) {
    ResizePadded(shape.out(layer), x.cols(), &hidden_[layer]);
    if (shape.layer_norm()) norms_[layer].Resize(shape.out(layer), x.cols());
  }
  output_.resize(shape.output_size(), x.cols());
  const Columns<const Element> input = Input(x, /*fresh=*/true);
  for (Eigen::Index first = 0; first < x.cols(); first += kBlockColumns) {
    const Eigen::Index n = std::min(kBlockColumns, x.cols() - first);
    Columns<const Element> from = input.Middle(first, n);
    for (int layer = 0; layer < last; ++layer) from = HiddenForward(parameters, layer, from, first);
    products_[last]->Output(Layer(parameters, last), from, ColumnsOf(&output_, first, n));
  }
  return output_;
}

template <class Element>
void MlpPass<Element>::ParameterGradient(const Parameters& parameters, const ConstMatrixRef<Sum>& x,
                                         const ConstMatrixRef<Sum>& dy, VectorX<Sum>* gradient) {
  const Eigen::Index n = x.cols();
  DBR_CHECK(dy.rows() == shape_.output_size() && dy.cols() == n);
  gradient->resize(shape_.parameter_count());
  for (int layer = 0; layer < shape_.layer_count(); ++layer) {
    gradient->segment(shape_.bias_offset(layer), shape_.vector_count(layer)).setZero();
  }
  ResizeDeltas(n);
  Columns<const Element> delta = OutputDelta(ColumnsOf<Sum>(dy, 0, n));
  const int last = shape_.layer_count() - 1;
  gradient->segment(shape_.bias_offset(last), shape_.out(last)) = dy.rowwise().sum();
  for (int layer = last; layer >= 0; --layer) {
    const Columns<const Element> input =
        layer == 0 ? Input(x, /*fresh=*/false) : Columns<const Element>(ColumnsOf(&hidden_[layer - 1], 0, n));
    products_[layer]->WeightGradient(delta, input, gradient->data() + shape_.weight_offset(layer));
    if (layer == 0) break;
    const Columns<Element> previous = ColumnsOf(&deltas_[layer - 1], 0, n);
    products_[layer]->HiddenGradient(Layer(parameters, layer), delta, previous);
    for (Eigen::Index j = 0; j < n; ++j) {
      HiddenBackward(parameters, layer - 1, j, previous.values + j * previous.stride, gradient->data());
    }
    delta = previous;
  }
}

template <class Element>
Eigen::Index MlpPass<Element>::GatherActive(const ConstMatrixRef<Sum>& dy, Eigen::Index first,
                                            Eigen::Index n) {
  active_.count = 0;
  active_dy_.resize(dy.rows(), kBlockColumns);
  for (Eigen::Index j = 0; j < n; ++j) {
    if ((dy.col(first + j).array() == Sum{0}).all()) continue;
    active_dy_.col(active_.count) = dy.col(first + j);
    active_.columns[active_.count++] = j;
  }
  const Eigen::Index padded = std::min(n, (active_.count + kColumnGroup - 1) / kColumnGroup * kColumnGroup);
  active_dy_.middleCols(active_.count, padded - active_.count).setZero();
  return padded;
}

template <class Element>
void MlpPass<Element>::Backpropagate(const Parameters& parameters, Columns<const Element> delta,
                                     Eigen::Index first, Columns<Sum> dx) {
  for (int layer = shape_.layer_count() - 1; layer > 0; --layer) {
    const Columns<Element> previous = ColumnsOf(&deltas_[layer - 1], first, delta.cols);
    products_[layer]->HiddenGradient(Layer(parameters, layer), delta, previous);
    for (Eigen::Index j = 0; j < active_.count; ++j) {
      HiddenBackward(parameters, layer - 1, first + active_.columns[j], previous.values + j * previous.stride,
                     nullptr);
    }
    delta = previous;
  }
  LayerParameters<Element> input_layer = Layer(parameters, 0);
  input_layer.weight += (shape_.input_size() - dx.rows) * input_layer.stride;
  products_[0]->InputGradient(input_layer, delta, {dx.values, dx.rows, delta.cols, dx.stride});
}

template <class Element>
void MlpPass<Element>::Scatter(Columns<Sum> dx) const {
  const auto column = [&](Eigen::Index j) { return dx.values + j * dx.stride; };
  Eigen::Index left = active_.count;
  for (Eigen::Index j = dx.cols - 1; j >= left; --j) {
    if (left > 0 && active_.columns[left - 1] == j) {
      std::copy_n(column(--left), dx.rows, column(j));
    } else {
      std::fill_n(column(j), dx.rows, Sum{0});
    }
  }
}

template <class Element>
void MlpPass<Element>::PrepareInputGradient(const Parameters& parameters, Eigen::Index n, Columns<Sum> dx) {
  if (n <= prepared_columns_) return;
  prepared_columns_ = n;
  active_.count = 0;
  active_dy_.setZero(shape_.output_size(), kBlockColumns);
  for (Eigen::Index columns = std::min(n, kColumnGroup);; columns = std::min(n, columns + kColumnGroup)) {
    Backpropagate(parameters, OutputDelta(ColumnsOf<Sum>(active_dy_, 0, columns)), 0, dx);
    if (columns == n) break;
  }
}

template <class Element>
void MlpPass<Element>::InputGradient(const Parameters& parameters, const ConstMatrixRef<Sum>& dy,
                                     Eigen::Index rows, MatrixX<Sum>* dx) {
  ResizeDeltas(dy.cols());
  dx->resize(rows, dy.cols());
  for (Eigen::Index first = 0; first < dy.cols(); first += kBlockColumns) {
    const Eigen::Index n = std::min(kBlockColumns, dy.cols() - first);
    const Columns<Sum> block = ColumnsOf(dx, first, n);
    PrepareInputGradient(parameters, n, block);
    const Eigen::Index columns = GatherActive(dy, first, n);
    if (columns > 0) {
      Backpropagate(parameters, OutputDelta(ColumnsOf<Sum>(active_dy_, 0, columns)), first, block);
    }
    Scatter(block);
  }
}

template <class Element>
void MlpPass<Element>::InputGradientOfDeltas(const Parameters& parameters, const ConstMatrixRef<Sum>& dy,
                                             MatrixX<Sum>* dx) {
  const Eigen::Index n = dy.cols();
  const Columns<const Element> delta = shape_.layer_count() == 1
                                           ? OutputDelta(ColumnsOf<Sum>(dy, 0, n))
                                           : Columns<const Element>(ColumnsOf(&deltas_[0], 0, n));
  dx->resize(shape_.input_size(), n);
  products_[0]->InputGradient(Layer(parameters, 0), delta, ColumnsOf(dx, 0, n));
}

template class MlpPass<float>;
template class MlpPass<double>;
template class MlpPass<Bfloat16>;

}  // namespace dbr
