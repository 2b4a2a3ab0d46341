// The threads of OpenBLAS: none but the caller's, always; we place threads ourselves.
#pragma once

namespace dbr {

// Keeps OpenBLAS from using threads of its own for matrix products.
void UseOneBlasThread();

// The same for a whole program, in the first line of its main, before signals are blocked. OpenBLAS starts
// its threads when it is loaded, where no mask of ours reaches: such a thread would take a SIGTERM and the
// program would die without draining. Unless OPENBLAS_NUM_THREADS is 1 already, sets it and executes the
// program again in the same process.
void RestartWithOneBlasThread(char** argv);

}  // namespace dbr
