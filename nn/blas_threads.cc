#include "nn/blas_threads.h"

#include <unistd.h>

#include <cstdlib>
#include <cstring>

extern "C" void openblas_set_num_threads(int threads);

namespace dbr {

void UseOneBlasThread() {
  openblas_set_num_threads(1);
}

void RestartWithOneBlasThread(char** argv) {
  constexpr char kVariable[] = "OPENBLAS_NUM_THREADS";
  const char* threads = std::getenv(kVariable);
  if (threads != nullptr && std::strcmp(threads, "1") == 0) return;
  setenv(kVariable, "1", /*overwrite=*/1);
  execv("/proc/self/exe", argv);
  UseOneBlasThread();  // where the program could not be executed again: at least no product uses them
}

}  // namespace dbr
