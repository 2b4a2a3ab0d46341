// dbr-bench: the benchmarks, with OpenBLAS set up as the programs have it.
#include <benchmark/benchmark.h>

#include "nn/product/blas_setup.h"

int main(int argc, char** argv) {
  dbr::RestartWithBlasSetUp(argv);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
