// A layer's products by oneDNN.
#pragma once

#include "nn/product/layer_products.h"

namespace dbr {

// float or Bfloat16. See LayerProducts. A ReLU's clipped entry y is y * 2^-64 instead of 0: oneDNN's ReLU
// with slope 0 takes a NaN for 0, and its leaky ReLU keeps it.
template <class Element>
std::unique_ptr<LayerProducts<Element>> MakeOneDnnLayer(const LayerSize& size);

}  // namespace dbr
