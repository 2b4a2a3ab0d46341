#include "nn/product/product_library.h"

#include <dnnl.hpp>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "nn/product/blas_layer.h"
#include "nn/product/layer_products.h"
#include "nn/product/onednn_layer.h"

extern "C" char* openblas_get_config();
extern "C" char* openblas_get_corename();

namespace dbr {
namespace {

// oneDNN numbers instruction sets by bits: a set has all the bits of the sets that it includes.
bool Has(dnnl::cpu_isa instructions) {
  const auto wanted = static_cast<unsigned>(instructions);
  return (static_cast<unsigned>(dnnl::get_effective_cpu_isa()) & wanted) == wanted;
}

}  // namespace

ProductLibrary Float32Library() {
  static const bool wide = Has(dnnl::cpu_isa::avx512_core);
  return wide ? ProductLibrary::kOneDnn : ProductLibrary::kOpenBlas;
}

bool HasBfloat16() {
  static const bool has = Has(dnnl::cpu_isa::avx512_core_bf16);
  return has;
}

std::string ProcessorInstructions() {
  switch (dnnl::get_effective_cpu_isa()) {
    case dnnl::cpu_isa::sse41:
      return "sse41";
    case dnnl::cpu_isa::avx:
      return "avx";
    case dnnl::cpu_isa::avx2:
      return "avx2";
    case dnnl::cpu_isa::avx2_vnni:
      return "avx2_vnni";
    case dnnl::cpu_isa::avx512_core:
      return "avx512_core";
    case dnnl::cpu_isa::avx512_core_vnni:
      return "avx512_core_vnni";
    case dnnl::cpu_isa::avx512_core_bf16:
      return "avx512_core_bf16";
    case dnnl::cpu_isa::avx512_core_amx:
      return "avx512_core_amx";
    default:
      return "other instructions";
  }
}

std::string KernelsName(bool bfloat16) {
  if (bfloat16 || Float32Library() == ProductLibrary::kOneDnn) {
    const dnnl_version_t& version = *dnnl::version();
    return absl::StrCat("oneDNN ", version.major, ".", version.minor, ".", version.patch, " (",
                        ProcessorInstructions(), "), ", bfloat16 ? "bfloat16" : "float32");
  }
  // The first two words of the configuration are the name and the version.
  const std::string config = openblas_get_config();
  return absl::StrCat(config.substr(0, config.find(' ', config.find(' ') + 1)), " (", openblas_get_corename(),
                      "), float32");
}

template <>
std::unique_ptr<LayerProducts<double>> MakeLayerProducts<double>(const LayerSize& size) {
  return MakeBlasLayer<double>(size);
}

template <>
std::unique_ptr<LayerProducts<float>> MakeLayerProducts<float>(const LayerSize& size) {
  return Float32Library() == ProductLibrary::kOneDnn ? MakeOneDnnLayer<float>(size)
                                                     : MakeBlasLayer<float>(size);
}

template <>
std::unique_ptr<LayerProducts<Bfloat16>> MakeLayerProducts<Bfloat16>(const LayerSize& size) {
  DBR_CHECK(HasBfloat16());
  return MakeOneDnnLayer<Bfloat16>(size);
}

}  // namespace dbr
