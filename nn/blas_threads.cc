#include "nn/blas_threads.h"

extern "C" void openblas_set_num_threads(int threads);

namespace dbr {

void UseOneBlasThread() {
  openblas_set_num_threads(1);
}

}  // namespace dbr
