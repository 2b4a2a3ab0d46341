// CRC-32C (Castagnoli, RFC 3720), as TFRecord and our snapshots use it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dbr {

// The checksum of `size` bytes appended to data whose checksum is `crc` (0 for none). Thread-safe. O(size),
// about 1 byte a cycle or better.
std::uint32_t ExtendCrc32c(std::uint32_t crc, const void* data, std::size_t size);

// The checksum of `size` bytes.
inline std::uint32_t Crc32c(const void* data, std::size_t size) {
  return ExtendCrc32c(0, data, size);
}

}  // namespace dbr
