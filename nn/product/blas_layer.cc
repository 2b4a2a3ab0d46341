#include "nn/product/blas_layer.h"

#include "nn/product/blas_product.h"

namespace dbr {
namespace {

template <class Scalar>
class BlasLayer final : public LayerProducts<Scalar> {
 public:
  explicit BlasLayer(const LayerSize& size) : size_(size) {}

  void Hidden(const LayerParameters<Scalar>& layer, Columns<const Scalar> x, Columns<Scalar> y) override {
    Multiply(layer, x, y);
    AddBias(layer.bias, /*relu=*/true, y);
  }
  void Output(const LayerParameters<Scalar>& layer, Columns<const Scalar> x, Columns<Scalar> y) override {
    Multiply(layer, x, y);
    AddBias(layer.bias, /*relu=*/false, y);
  }
  void HiddenGradient(const LayerParameters<Scalar>& layer, Columns<const Scalar> delta,
                      Columns<Scalar> dx) override {
    const Operand<Scalar> weight{layer.weight, size_.out, dx.rows, layer.stride};
    Product(Transposed(weight), OperandOf(delta), dx.values, dx.stride);
  }
  void InputGradient(const LayerParameters<Scalar>& layer, Columns<const Scalar> delta,
                     Columns<Scalar> dx) override {
    HiddenGradient(layer, delta, dx);
  }
  void WeightGradient(Columns<const Scalar> delta, Columns<const Scalar> x, Scalar* dw) override {
    Product(OperandOf(delta), Transposed(OperandOf(x)), dw, size_.out);
  }

 private:
  static Operand<Scalar> OperandOf(const Columns<const Scalar>& x) {
    return {x.values, x.rows, x.cols, x.stride};
  }
  Operand<Scalar> Weight(const LayerParameters<Scalar>& layer) const {
    return {layer.weight, size_.out, size_.in, layer.stride};
  }
  void Multiply(const LayerParameters<Scalar>& layer, const Columns<const Scalar>& x,
                const Columns<Scalar>& y) {
    Product(Weight(layer), OperandOf(x), y.values, y.stride);
  }

  // Adds the bias to each column and clips at zero where `relu`, in one pass. A NaN stays one
  // (nn/keep_nan.h).
  static void AddBias(const Scalar* bias, bool relu, const Columns<Scalar>& y) {
    using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
    const Eigen::Map<const Vector> b(bias, y.rows);
    for (Eigen::Index j = 0; j < y.cols; ++j) {
      Eigen::Map<Vector> column(y.values + j * y.stride, y.rows);
      if (relu) {
        column = (column + b).cwiseMax(Scalar{0});
      } else {
        column += b;
      }
    }
  }

  const LayerSize size_;
};

}  // namespace

template <class Scalar>
std::unique_ptr<LayerProducts<Scalar>> MakeBlasLayer(const LayerSize& size) {
  return std::make_unique<BlasLayer<Scalar>>(size);
}

template std::unique_ptr<LayerProducts<float>> MakeBlasLayer<float>(const LayerSize&);
template std::unique_ptr<LayerProducts<double>> MakeBlasLayer<double>(const LayerSize&);

}  // namespace dbr
