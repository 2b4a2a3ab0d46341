#include "nn/precision.h"

#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "nn/product/product_library.h"

namespace dbr {

absl::StatusOr<bool> UsesBfloat16(const NetworkConfig& config) {
  if (config.precision() == NetworkConfig::FLOAT32) return false;
  if (HasBfloat16()) return true;
  if (config.precision() == NetworkConfig::AUTO) return false;
  const char* const limit = std::getenv("DNNL_MAX_CPU_ISA");
  return absl::InvalidArgumentError(absl::StrCat(
      "network.precision: BFLOAT16 needs a processor with avx512_bf16 or amx_bf16, found ",
      ProcessorInstructions(),
      limit != nullptr ? absl::StrCat(" (the environment sets DNNL_MAX_CPU_ISA=", limit, ")") : "",
      ". Use AUTO or FLOAT32."));
}

}  // namespace dbr
