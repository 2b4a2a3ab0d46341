// Which library makes the matrix products of this process, and what the processor offers to it.
#pragma once

#include <string>

namespace dbr {

// The library of products in single precision. OpenBLAS makes those in double precision everywhere, and
// oneDNN those in bfloat16.
enum class ProductLibrary { kOpenBlas, kOneDnn };

// oneDNN where the processor has AVX-512 and DNNL_MAX_CPU_ISA, which oneDNN reads, does not take it away;
// else OpenBLAS: with AVX2 alone oneDNN 2.6 reaches half of its speed. It is the same for the whole process.
ProductLibrary Float32Library();

// True where the processor multiplies bfloat16 (avx512_bf16 or amx_bf16), and DNNL_MAX_CPU_ISA leaves it.
bool HasBfloat16();

// The instructions that oneDNN uses: "avx512_core_amx".
std::string ProcessorInstructions();

// The kernels of a precision, for people: "oneDNN 2.6.3 (avx512_core_amx), bfloat16" or "OpenBLAS 0.3.21
// (Haswell), float32".
std::string KernelsName(bool bfloat16);

}  // namespace dbr
