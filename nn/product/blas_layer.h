// A layer's products by OpenBLAS.
#pragma once

#include "nn/product/layer_products.h"

namespace dbr {

// Single or double precision. See LayerProducts.
template <class Scalar>
std::unique_ptr<LayerProducts<Scalar>> MakeBlasLayer(const LayerSize& size);

}  // namespace dbr
