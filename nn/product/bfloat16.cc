#include "nn/product/bfloat16.h"

#include <cstdint>
#include <cstring>

namespace dbr {

void RoundToBfloat16(const float* values, Eigen::Index n, Bfloat16* rounded) {
  static_assert(sizeof(Bfloat16) == sizeof(std::uint16_t));
  std::uint16_t* const __restrict out = reinterpret_cast<std::uint16_t*>(rounded);
  for (Eigen::Index i = 0; i < n; ++i) {
    std::uint32_t bits;
    std::memcpy(&bits, values + i, sizeof(bits));
    const std::uint32_t nearest = (bits + 0x7fff + ((bits >> 16) & 1)) >> 16;
    const bool nan = (bits & 0x7fffffff) > 0x7f800000;
    out[i] = static_cast<std::uint16_t>(nan ? 0x7fc0 : nearest);
  }
}

}  // namespace dbr
