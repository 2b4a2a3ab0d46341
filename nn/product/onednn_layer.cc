#include "nn/product/onednn_layer.h"

#include <cstdio>
#include <cstdlib>
#include <dnnl.hpp>
#include <memory>
#include <vector>

#include "core/check.h"

extern "C" void omp_set_num_threads(int threads);

namespace dbr {
namespace {

using Tensor = dnnl::memory;
using DataType = dnnl::memory::data_type;

// The slope of the ReLU below 0 (see the header). Times a sum of any likely size it is below the last digit
// of everything that it is added to, and above the smallest normal number, which processors multiply fast.
constexpr float kSlope = 0x1p-64f;

template <class Element>
constexpr DataType TypeOf() {
  return std::is_same_v<Element, Bfloat16> ? DataType::bf16 : DataType::f32;
}

// oneDNN must not use threads of its own, because we place threads ourselves. OpenMP keeps that setting for
// each thread.
void UseOneOpenMpThread() {
  thread_local const bool once = [] {
    omp_set_num_threads(1);
    return true;
  }();
  (void)once;
}

const dnnl::engine& Engine() {
  static const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  return engine;
}

// A matrix as oneDNN reads it: entry (i, j) lies at i * strides[0] + j * strides[1].
struct Matrix {
  Eigen::Index rows, cols;
  Eigen::Index strides[2];
  DataType type;

  Tensor::desc Describe() const { return {{rows, cols}, type, {strides[0], strides[1]}}; }
  bool operator==(const Matrix&) const = default;
};

// What is known of a product c = a b before it is made. oneDNN's matrices have a sample in each row.
struct ProductShape {
  Matrix a, b, c;
  bool bias = false;
  bool relu = false;

  bool operator==(const ProductShape&) const = default;
};

// A tensor whose memory is set before each use.
Tensor WithoutMemory(const Tensor::desc& description) {
  return Tensor(description, Engine(), DNNL_MEMORY_NONE);
}

// oneDNN's primitive for one shape, with its scratchpad and the handles that its operands are put into.
class Primitive {
 public:
  explicit Primitive(const ProductShape& shape) : shape_(shape), stream_(Engine()) {
    try {
      Make();
    } catch (const dnnl::error& error) {
      std::fprintf(stderr, "oneDNN cannot multiply [%td x %td] by [%td x %td]: %s\n", shape.a.rows,
                   shape.a.cols, shape.b.rows, shape.b.cols, error.what());
      std::abort();
    }
  }

  const ProductShape& shape() const { return shape_; }

  void Run(const void* a, const void* b, const void* bias, void* c) {
    const void* const operands[] = {a, b, c, bias};
    for (std::size_t i = 0; i < tensors_.size(); ++i) {
      dnnl_memory_set_data_handle(tensors_[i].get(), const_cast<void*>(operands[i]));
    }
    const dnnl_status_t status = dnnl_primitive_execute(
        product_.get(), stream_.get(), static_cast<int>(arguments_.size()), arguments_.data());
    DBR_CHECK(status == dnnl_success);
  }

 private:
  void Make() {
    const Tensor::desc a = shape_.a.Describe(), b = shape_.b.Describe(), c = shape_.c.Describe();
    const Tensor::desc bias({1, shape_.c.cols}, DataType::f32, Tensor::format_tag::ab);
    dnnl::primitive_attr attributes;
    attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
    if (shape_.relu) {
      dnnl::post_ops after;
      after.append_eltwise(1.0f, dnnl::algorithm::eltwise_relu, kSlope, 0.0f);
      attributes.set_post_ops(after);
    }
    const dnnl::matmul::desc product =
        shape_.bias ? dnnl::matmul::desc(a, b, bias, c) : dnnl::matmul::desc(a, b, c);
    const dnnl::matmul::primitive_desc chosen(product, attributes, Engine());
    product_ = dnnl::matmul(chosen);
    for (const Tensor::desc& operand : {a, b, c}) tensors_.push_back(WithoutMemory(operand));
    if (shape_.bias) tensors_.push_back(WithoutMemory(bias));
    scratchpad_ = Tensor(chosen.scratchpad_desc(), Engine());
    constexpr int kNames[] = {DNNL_ARG_SRC, DNNL_ARG_WEIGHTS, DNNL_ARG_DST, DNNL_ARG_BIAS};
    for (std::size_t i = 0; i < tensors_.size(); ++i) arguments_.push_back({kNames[i], tensors_[i].get()});
    arguments_.push_back({DNNL_ARG_SCRATCHPAD, scratchpad_.get()});
  }

  const ProductShape shape_;
  dnnl::stream stream_;
  dnnl::matmul product_;
  std::vector<Tensor> tensors_;  // a, b, c and the bias, where there is one
  Tensor scratchpad_;
  std::vector<dnnl_exec_arg_t> arguments_;
};

template <class Element>
class OneDnnLayer final : public LayerProducts<Element> {
 public:
  using Sum = SumOf<Element>;

  explicit OneDnnLayer(const LayerSize& size) : size_(size) {}

  void Hidden(const LayerParameters<Element>& layer, Columns<const Element> x, Columns<Element> y) override {
    Forward(layer, x, y, /*relu=*/true);
  }
  void Output(const LayerParameters<Element>& layer, Columns<const Element> x, Columns<Sum> y) override {
    Forward(layer, x, y, /*relu=*/false);
  }
  void HiddenGradient(const LayerParameters<Element>& layer, Columns<const Element> delta,
                      Columns<Element> dx) override {
    Backward(layer, delta, dx);
  }
  void InputGradient(const LayerParameters<Element>& layer, Columns<const Element> delta,
                     Columns<Sum> dx) override {
    Backward(layer, delta, dx);
  }
  void WeightGradient(Columns<const Element> delta, Columns<const Element> x, Sum* dw) override {
    const Matrix a{size_.in, x.cols, {1, x.stride}, TypeOf<Element>()};
    const Matrix b{x.cols, size_.out, {delta.stride, 1}, TypeOf<Element>()};
    const Matrix c{size_.in, size_.out, {size_.out, 1}, TypeOf<Sum>()};
    Run({a, b, c}, x.values, delta.values, nullptr, dw);
  }

 private:
  template <class Result>
  void Forward(const LayerParameters<Element>& layer, const Columns<const Element>& x,
               const Columns<Result>& y, bool relu) {
    const Matrix b{x.rows, y.rows, {layer.stride, 1}, TypeOf<Element>()};
    Run({Samples(x, x.rows), b, Samples(y, y.rows), /*bias=*/true, relu}, x.values, layer.weight, layer.bias,
        y.values);
  }
  template <class Result>
  void Backward(const LayerParameters<Element>& layer, const Columns<const Element>& delta,
                const Columns<Result>& dx) {
    const Matrix b{delta.rows, dx.rows, {1, layer.stride}, TypeOf<Element>()};
    Run({Samples(delta, delta.rows), b, Samples(dx, dx.rows)}, delta.values, layer.weight, nullptr,
        dx.values);
  }

  // A column-major matrix of samples in columns is a row-major one of samples in rows.
  template <class Entry>
  static Matrix Samples(const Columns<Entry>& x, Eigen::Index features) {
    return {x.cols, features, {x.stride, 1}, TypeOf<std::remove_const_t<Entry>>()};
  }

  void Run(const ProductShape& shape, const void* a, const void* b, const void* bias, void* c) {
    UseOneOpenMpThread();
    for (const auto& primitive : primitives_) {
      if (primitive->shape() == shape) return primitive->Run(a, b, bias, c);
    }
    primitives_.push_back(std::make_unique<Primitive>(shape));
    primitives_.back()->Run(a, b, bias, c);
  }

  const LayerSize size_;
  std::vector<std::unique_ptr<Primitive>> primitives_;
};

}  // namespace

template <class Element>
std::unique_ptr<LayerProducts<Element>> MakeOneDnnLayer(const LayerSize& size) {
  return std::make_unique<OneDnnLayer<Element>>(size);
}

template std::unique_ptr<LayerProducts<float>> MakeOneDnnLayer<float>(const LayerSize&);
template std::unique_ptr<LayerProducts<Bfloat16>> MakeOneDnnLayer<Bfloat16>(const LayerSize&);

}  // namespace dbr
