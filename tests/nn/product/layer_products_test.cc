// Tests each library's products of a layer against sums in double precision, for the shapes that networks use
// and for odd ones.
#include "nn/product/layer_products.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/batch.h"
#include "core/rng.h"
#include "nn/product/blas_layer.h"
#include "nn/product/onednn_layer.h"
#include "nn/product/product_library.h"

namespace dbr {
namespace {

using Double = MatrixX<double>;

struct Shape {
  Eigen::Index in, out, n;
};
// The robots' and Connect-4's networks, BEAR's VAE, and odd sizes.
constexpr Shape kShapes[] = {
    {15, 256, 256},  {18, 256, 256},  {22, 256, 256}, {28, 256, 256}, {36, 256, 256}, {84, 256, 256},
    {256, 256, 256}, {256, 256, 100}, {256, 256, 32}, {256, 1, 256},  {256, 6, 256},  {256, 16, 256},
    {256, 7, 1},     {128, 128, 128}, {44, 750, 60},  {750, 750, 5},  {750, 8, 31},   {1, 1, 1},
    {3, 13, 33},     {33, 3, 1},      {13, 33, 5},    {5, 1, 7}};

// A library's products with elements of one kind.
template <class E>
struct Blas {
  using Element = E;
  static bool Runs() { return true; }
  static std::unique_ptr<LayerProducts<E>> Make(const LayerSize& size) { return MakeBlasLayer<E>(size); }
};
template <class E>
struct OneDnn {
  using Element = E;
  static bool Runs() { return std::is_same_v<E, Bfloat16> ? HasBfloat16() : true; }
  static std::unique_ptr<LayerProducts<E>> Make(const LayerSize& size) { return MakeOneDnnLayer<E>(size); }
};

// A layer's operands in padded and strided memory, and the same numbers in double precision.
template <class Element>
struct Operands {
  using Sum = SumOf<Element>;

  explicit Operands(const Shape& shape) : shape(shape) {
    Rng rng(static_cast<std::uint64_t>(shape.in * 1000003 + shape.out * 1009 + shape.n));
    weight = Fill(shape.out, shape.in, rng, &weight_d);
    x = Fill(shape.in, shape.n, rng, &x_d);
    delta = Fill(shape.out, shape.n, rng, &delta_d);
    bias.resize(shape.out);
    for (Sum& value : bias) value = static_cast<Sum>(rng.Normal());
  }

  // Random numbers that Element holds exactly, with rows and columns of zeros as PaddedRows asks.
  static MatrixX<Element> Fill(Eigen::Index rows, Eigen::Index cols, Rng& rng, Double* exact) {
    const Eigen::Index padded = PaddedRows<Element>(rows);
    MatrixX<Element> matrix = MatrixX<Element>::Constant(padded, PaddedRows<Element>(cols), Element(0));
    exact->resize(rows, cols);
    for (Eigen::Index j = 0; j < cols; ++j) {
      for (Eigen::Index i = 0; i < rows; ++i) {
        matrix(i, j) = Element(static_cast<float>(rng.Normal()));
        (*exact)(i, j) = static_cast<double>(matrix(i, j));
      }
    }
    return matrix;
  }
  template <class E>
  static Columns<const E> Padded(const MatrixX<E>& matrix, Eigen::Index n) {
    return {matrix.data(), matrix.rows(), n, matrix.rows()};
  }
  LayerParameters<Element> layer() const { return {weight.data(), weight.rows(), bias.data()}; }

  const Shape shape;
  MatrixX<Element> weight, x, delta;
  VectorX<Sum> bias;
  Double weight_d, x_d, delta_d;
};

// Compares with what double precision gives: the sum's error is a float's (or a double's) in terms of the sum
// of the absolute products, and the result's rounding comes on top.
template <class Result>
void ExpectClose(const MatrixX<Result>& result, const Double& expected, const Double& sizes) {
  constexpr bool kDouble = std::is_same_v<Result, double>;
  constexpr double kSum = kDouble ? 1e-14 : 2e-6;
  constexpr double kResult = std::is_same_v<Result, Bfloat16> ? 0x1p-8 : 0;
  ASSERT_EQ(result.rows(), expected.rows());
  for (Eigen::Index j = 0; j < expected.cols(); ++j) {
    for (Eigen::Index i = 0; i < expected.rows(); ++i) {
      const double tolerance = kSum * sizes(i, j) + kResult * std::abs(expected(i, j)) + 1e-30;
      ASSERT_NEAR(static_cast<double>(result(i, j)), expected(i, j), tolerance) << i << ", " << j;
    }
  }
}

template <class Library>
class LayerProductsTest : public testing::Test {
 protected:
  using Element = typename Library::Element;
  using Sum = SumOf<Element>;

  void SetUp() override {
    if (!Library::Runs()) GTEST_SKIP() << "the processor has no bfloat16";
  }

  // Calls `function` with the operands, the products and the sum of absolute products of a pass.
  template <class Function>
  void ForEachShape(const Function& function) {
    for (const Shape& shape : kShapes) {
      SCOPED_TRACE(testing::Message() << shape.in << " -> " << shape.out << ", " << shape.n << " samples");
      const Operands<Element> at(shape);
      const auto products = Library::Make({shape.in, shape.out});
      for (int call = 0; call < 2; ++call) function(at, *products);  // what is made in the first is kept
      if (testing::Test::HasFatalFailure()) return;
    }
  }
};

using Libraries = testing::Types<Blas<double>, Blas<float>, OneDnn<float>, OneDnn<Bfloat16>>;
struct Names {
  template <class Library>
  static std::string GetName(int index) {
    return std::vector<std::string>{"BlasDouble", "BlasFloat", "OneDnnFloat", "OneDnnBfloat16"}[index];
  }
};
TYPED_TEST_SUITE(LayerProductsTest, Libraries, Names);

TYPED_TEST(LayerProductsTest, ForwardAgreesWithDouble) {
  using Element = typename TypeParam::Element;
  using Sum = SumOf<Element>;
  this->ForEachShape([](const Operands<Element>& at, LayerProducts<Element>& products) {
    const Double bias = at.bias.template cast<double>().replicate(1, at.shape.n);
    const Double y = at.weight_d * at.x_d + bias;
    const Double sizes = at.weight_d.cwiseAbs() * at.x_d.cwiseAbs() + bias.cwiseAbs();
    const auto x = at.Padded(at.x, at.shape.n);
    MatrixX<Sum> output(at.shape.out, at.shape.n);
    products.Output(at.layer(), x, {output.data(), output.rows(), output.cols(), output.rows()});
    ExpectClose(output, y, sizes);
    MatrixX<Element> hidden(at.shape.out, at.shape.n);
    products.Hidden(at.layer(), x, {hidden.data(), hidden.rows(), hidden.cols(), hidden.rows()});
    ExpectClose<Element>(hidden, y.cwiseMax(0), sizes);
    for (Eigen::Index i = 0; i < hidden.size(); ++i) {
      if (y.data()[i] < -2e-6 * sizes.data()[i]) {
        ASSERT_LE(static_cast<double>(hidden.data()[i]), 0);
      }
    }
  });
}

TYPED_TEST(LayerProductsTest, BackwardAgreesWithDouble) {
  using Element = typename TypeParam::Element;
  using Sum = SumOf<Element>;
  this->ForEachShape([](const Operands<Element>& at, LayerProducts<Element>& products) {
    const Double dx = at.weight_d.transpose() * at.delta_d;
    const Double sizes = at.weight_d.cwiseAbs().transpose() * at.delta_d.cwiseAbs();
    const auto delta = at.Padded(at.delta, at.shape.n);
    MatrixX<Element> hidden(at.shape.in, at.shape.n);
    products.HiddenGradient(at.layer(), delta, {hidden.data(), hidden.rows(), hidden.cols(), hidden.rows()});
    ExpectClose(hidden, dx, sizes);
    MatrixX<Sum> input(at.shape.in, at.shape.n);
    products.InputGradient(at.layer(), delta, {input.data(), input.rows(), input.cols(), input.rows()});
    ExpectClose(input, dx, sizes);
    MatrixX<Sum> dw(at.shape.out, at.shape.in);
    products.WeightGradient(
        Columns<const Element>{at.delta.data(), at.shape.out, at.shape.n, at.delta.rows()},
        {at.x.data(), at.shape.in, at.shape.n, at.x.rows()}, dw.data());
    ExpectClose<Sum>(dw, at.delta_d * at.x_d.transpose(),
                     at.delta_d.cwiseAbs() * at.x_d.cwiseAbs().transpose());
  });
}

// The gradient at the first inputs alone, as the policy's gradient through a critic wants it.
TYPED_TEST(LayerProductsTest, TheInputGradientMayHaveFewerRows) {
  using Element = typename TypeParam::Element;
  using Sum = SumOf<Element>;
  const Operands<Element> at({36, 256, 100});
  const auto products = TypeParam::Make({36, 256});
  MatrixX<Sum> dx(8, 100);
  products->InputGradient(at.layer(), at.Padded(at.delta, 100), {dx.data(), 8, 100, 8});
  ExpectClose<Sum>(dx, (at.weight_d.transpose() * at.delta_d).topRows(8),
                   (at.weight_d.cwiseAbs().transpose() * at.delta_d.cwiseAbs()).topRows(8));
}

// A product that took a NaN for 0 would make a broken network look sound.
TYPED_TEST(LayerProductsTest, ANaNReachesTheOutputThroughTheRelu) {
  using Element = typename TypeParam::Element;
  for (const Shape& shape : {Shape{36, 256, 256}, Shape{3, 13, 1}}) {
    for (const int place : {0, 1, 2}) {
      Operands<Element> at(shape);
      if (place == 0) at.bias[2] = NAN;
      if (place == 1) at.weight(2, 1) = Element(NAN);
      if (place == 2) at.x(1, 0) = Element(NAN);
      const auto products = TypeParam::Make({shape.in, shape.out});
      MatrixX<Element> y(shape.out, shape.n);
      products->Hidden(at.layer(), at.Padded(at.x, shape.n), {y.data(), y.rows(), y.cols(), y.rows()});
      EXPECT_TRUE(std::isnan(static_cast<double>(y(2, 0)))) << "place " << place;
    }
  }
}

TEST(ProductLibraryTest, NamesTheKernelsOfEachPrecision) {
  EXPECT_THAT(KernelsName(/*bfloat16=*/true), testing::ContainsRegex("^oneDNN 2\\..*, bfloat16$"));
  EXPECT_THAT(KernelsName(/*bfloat16=*/false),
              testing::ContainsRegex(Float32Library() == ProductLibrary::kOneDnn ? "^oneDNN 2\\..*, float32$"
                                                                                 : "^OpenBLAS .*, float32$"));
}

// The instructions that decide are the processor's own, unless DNNL_MAX_CPU_ISA takes some away.
TEST(ProductLibraryTest, BfloatNeedsTheInstructionsThatAreNamed) {
  const std::string instructions = ProcessorInstructions();
  EXPECT_EQ(HasBfloat16(), instructions == "avx512_core_bf16" || instructions == "avx512_core_amx");
  EXPECT_EQ(Float32Library() == ProductLibrary::kOneDnn, instructions.rfind("avx512", 0) == 0);
}

}  // namespace
}  // namespace dbr
