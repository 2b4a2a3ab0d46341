// How OpenBLAS works in our programs: in the caller's thread alone, because we place threads ourselves, and
// with a kernel that suits the processor.
#pragma once

#include "absl/status/status.h"

namespace dbr {

// Keeps OpenBLAS from using threads of its own for matrix products.
void UseOneBlasThread();

// Sets OpenBLAS up for a whole program and the programs that it starts. Belongs in the first line of main,
// before signals are blocked: it executes the program again in the same process, with OPENBLAS_NUM_THREADS=1
// and, where RunsOtherKernel() and SlowKernel() say so, OPENBLAS_CORETYPE. OpenBLAS reads both while it is
// loaded and starts its threads then, before main can block a signal: such a thread would take a SIGTERM and
// the program would die without draining. Does nothing where OPENBLAS_NUM_THREADS is 1 already.
void RestartWithBlasSetUp(char** argv);

// Checks that `threads` threads can multiply at once. OpenBLAS takes a buffer of address space for each, and
// where it gets none it asks again for ever; a limit of `ulimit -v`, or a machine without memory to promise,
// is found here. ResourceExhausted says how much was asked for. Belongs before the first product, where
// others can still be told; it takes and gives back the address space and touches no memory.
absl::Status CheckBlasMemory(int threads);

// A matrix product by a plain loop: c = a b, all column-major [kTrialSize x kTrialSize].
inline constexpr int kTrialSize = 64;
void PlainProduct(const float* a, const float* b, float* c);

// True where OpenBLAS's own choice of kernel, by the processor's model, is slower than 1 / 1.3 of a plain
// loop: it then does not suit the processor. (OpenBLAS 0.3.21 on AMD's first Zen: 10 GFLOP/s, a plain loop
// 20, and OpenBLAS's kernel for an older AMD processor 33.) Takes 2 ms, or 20 where the kernel is slow.
bool SlowKernel();

// True where the processor executes all instructions of the kernel that is taken in place of a slow one:
// FMA4, which only AMD's processors have. Its first Zen executes them and does not say so.
bool RunsOtherKernel();

}  // namespace dbr
