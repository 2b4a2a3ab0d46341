// How OpenBLAS works in our programs: in the caller's thread alone, because we place threads ourselves, and
// with a kernel that suits the processor.
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"

namespace dbr {

// Keeps OpenBLAS from using threads of its own for matrix products.
void UseOneBlasThread();

// Sets OpenBLAS up for a whole program and the programs that it starts. Belongs in the first line of main,
// before signals are blocked: it executes the program again in the same process, with OPENBLAS_NUM_THREADS=1
// and, where OpenBLAS's own choice of kernel does not suit the processor, OPENBLAS_CORETYPE=BetterKernel(),
// unless that is set already. OpenBLAS reads both while it is loaded and starts its threads then, before main
// can block a signal: such a thread would take a SIGTERM and the program would die without draining. Does
// nothing where both are as they should be.
void RestartWithBlasSetUp(char** argv);

// Checks that `threads` threads can multiply at once. OpenBLAS takes a buffer of address space for each, and
// where it gets none it asks again for ever; a limit of `ulimit -v`, or a machine without memory to promise,
// is found here. ResourceExhausted says how much was asked for. Belongs before the first product, where
// others can still be told; it takes and gives back the address space and touches no memory.
absl::Status CheckBlasMemory(int threads);

// The kernel of OpenBLAS to take in place of its own choice, by the instructions that the processor executes;
// "" where its own choice is good. OpenBLAS 0.3.21 chooses by the processor's model and has two kinds of
// fault:
//   - A model that it does not know gets the kernel of 2004, for SSE3: on Intel's Emerald Rapids 22 GFLOP/s,
//     where its kernel for AVX-512 makes 150. With AVX2 and FMA, a kernel without them is never right.
//   - AMD's first Zen gets a kernel of 10 GFLOP/s where a plain loop makes 20, and OpenBLAS's kernel for an
//     older AMD processor 33. That is measured (SlowKernel), in 2 ms, or 20 where the kernel is slow.
std::string BetterKernel();

// What BetterKernel goes by. `own` is OpenBLAS's choice, as it names it; `slow` is called at most once.
struct ProcessorFeatures {
  bool avx512 = false;  // F, CD, BW, DQ and VL
  bool avx2_fma = false;
  bool first_zen = false;  // FMA4 without AVX2's speed: AMD's, the first Zen, which does not say so, included
};
std::string ChooseKernel(const ProcessorFeatures& processor, const std::string& own,
                         const std::function<bool()>& slow);

// A matrix product by a plain loop: c = a b, all column-major [kTrialSize x kTrialSize].
inline constexpr int kTrialSize = 64;
void PlainProduct(const float* a, const float* b, float* c);

// True where OpenBLAS's product takes longer than 1.3 times a plain loop's: its kernel does not suit the
// processor then. A busy machine may make it seem so anywhere.
bool SlowKernel();

}  // namespace dbr
