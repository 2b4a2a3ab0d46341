// The interface behind which matrix products are made: those of one dense layer, forward and backward. A
// library that makes them is one class that implements it (blas_layer.h, onednn_layer.h), chosen in
// product_library.h.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "nn/product/bfloat16.h"

namespace dbr {

// Columns of a column-major matrix in memory that somebody else owns.
template <class Element>
struct Columns {
  Element* values;
  Eigen::Index rows;
  Eigen::Index cols;
  Eigen::Index stride;  // from one column to the next

  // The same memory from column `first` on, `n` columns.
  Columns Middle(Eigen::Index first, Eigen::Index n) const {
    return {values + first * stride, rows, n, stride};
  }
  operator Columns<const Element>() const { return {values, rows, cols, stride}; }
};

// The parameters of a layer: its weight [out x in], column-major, and its bias [out], both padded as the
// layer's inputs and outputs are.
template <class Element>
struct LayerParameters {
  const Element* weight;
  Eigen::Index stride;  // from one column of the weight to the next
  const SumOf<Element>* bias;
};

// A layer's inputs and outputs.
struct LayerSize {
  Eigen::Index in = 0;
  Eigen::Index out = 0;
};

// The products of one layer, y = W x + b and its gradients, for samples in columns. Results overwrite what
// stood there. All matrices of Elements may have more rows than the layer has inputs or outputs (PaddedRows):
// those of x and delta are 0, those of y and dx become 0. The weight has columns, or rows, for them that are
// 0 too, and the bias entries. Everything that a library needs for a shape is made when the shape comes for
// the first time and kept: afterwards nothing is made or allocated. One thread at a time; no threads inside.
// The same arguments give the same bits.
template <class Element>
class LayerProducts {
 public:
  using Sum = SumOf<Element>;

  virtual ~LayerProducts() = default;

  // y [out x n] = relu(W x + b), from x [in x n]. A NaN stays one. An entry that the ReLU clips is not above
  // 0; it is 0 but for rounding.
  virtual void Hidden(const LayerParameters<Element>& layer, Columns<const Element> x,
                      Columns<Element> y) = 0;
  // y [out x n] = W x + b, from x [in x n]. y may be padded too.
  virtual void Output(const LayerParameters<Element>& layer, Columns<const Element> x, Columns<Sum> y) = 0;
  // dx = W^T delta, from delta [out x n]: the gradient at another layer's output. dx may have fewer rows than
  // the layer has inputs: it is the gradient at the first ones then.
  virtual void HiddenGradient(const LayerParameters<Element>& layer, Columns<const Element> delta,
                              Columns<Element> dx) = 0;
  // The same at the network's input.
  virtual void InputGradient(const LayerParameters<Element>& layer, Columns<const Element> delta,
                             Columns<Sum> dx) = 0;
  // dw [out x in] = delta x^T, without padding.
  virtual void WeightGradient(Columns<const Element> delta, Columns<const Element> x, Sum* dw) = 0;
};

// Makes the products of a layer with the library that this process uses for Elements: float, double or
// Bfloat16. Bfloat16 requires HasBfloat16() (product_library.h).
template <class Element>
std::unique_ptr<LayerProducts<Element>> MakeLayerProducts(const LayerSize& size);

}  // namespace dbr
