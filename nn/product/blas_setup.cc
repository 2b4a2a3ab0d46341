#include "nn/product/blas_setup.h"

#include <cblas.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

extern "C" void openblas_set_num_threads(int threads);
extern "C" char* openblas_get_corename();

namespace dbr {
namespace {

constexpr char kThreads[] = "OPENBLAS_NUM_THREADS";
constexpr char kKernel[] = "OPENBLAS_CORETYPE";
// This kernel multiplies and adds halves of a vector at once, which is right where a processor splits vectors
// anyway.
constexpr char kFirstZenKernel[] = "Excavator";
// OpenBLAS's kernels for processors without FMA, by its names. The first is what it takes for a model that it
// does not know.
constexpr const char* kKernelsWithoutFma[] = {"Prescott",   "Core2",   "Atom",    "Penryn",
                                              "Dunnington", "Nehalem", "Opteron", "Opteron_SSE3",
                                              "Barcelona",  "Nano",    "Bobcat",  "Sandybridge"};

// What OpenBLAS takes for a thread's products: BUFFER_SIZE of its kernels for x86-64.
constexpr std::size_t kBytesOfABuffer = std::size_t{128} << 20;
// For all else that a program does once it has begun: stacks of threads, heaps, environments.
constexpr std::size_t kBytesBeside = std::size_t{256} << 20;

// The least seconds of a few runs, for others may hold the core meanwhile.
template <class Function>
double LeastSeconds(const Function& function) {
  double least = 1;
  for (int run = 0; run < 5; ++run) {
    const auto start = std::chrono::steady_clock::now();
    function();
    least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return least;
}

}  // namespace

void UseOneBlasThread() {
  openblas_set_num_threads(1);
}

absl::Status CheckBlasMemory(int threads) {
  const std::size_t bytes = kBytesBeside + kBytesOfABuffer * static_cast<std::size_t>(std::max(threads, 1));
  void* const memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory != MAP_FAILED) {
    munmap(memory, bytes);
    return absl::OkStatus();
  }
  const std::string reason = std::strerror(errno);
  return absl::ResourceExhaustedError(
      absl::StrCat("cannot multiply matrices: expected ", bytes >> 20, " MiB of address space for ",
                   std::max(threads, 1), threads > 1 ? " threads" : " thread", ", found less (", reason,
                   "). Raise the limit that `ulimit -v` shows, or free memory."));
}

void PlainProduct(const float* a, const float* b, float* c) {
  constexpr int kRows = 16, kCols = 4;  // of a tile that stays in registers
  for (int column = 0; column < kTrialSize; column += kCols) {
    for (int row = 0; row < kTrialSize; row += kRows) {
      float tile[kCols][kRows] = {};
      for (int k = 0; k < kTrialSize; ++k) {
        for (int j = 0; j < kCols; ++j) {
          const float factor = b[(column + j) * kTrialSize + k];
          for (int i = 0; i < kRows; ++i) tile[j][i] += a[k * kTrialSize + row + i] * factor;
        }
      }
      for (int j = 0; j < kCols; ++j) std::copy_n(tile[j], kRows, c + (column + j) * kTrialSize + row);
    }
  }
}

bool SlowKernel() {
  constexpr int kSize = 4 * kTrialSize;  // where OpenBLAS is at its best
  const std::vector<float> a(kSize * kSize, 1.0f), b = a;
  std::vector<float> c(a.size());
  const double plain = LeastSeconds([&] { PlainProduct(a.data(), b.data(), c.data()); });
  const double blas = LeastSeconds([&] {
    cblas_sgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, kSize, kSize, kSize, 1.0f, a.data(), kSize,
                b.data(), kSize, 0.0f, c.data(), kSize);
  });
  const double share = blas / (plain * 64);  // the larger product has 64 times the operations
  return share > 1.3;
}

std::string ChooseKernel(const ProcessorFeatures& processor, const std::string& own,
                         const std::function<bool()>& slow) {
  if (processor.first_zen) return slow() ? kFirstZenKernel : "";
  if (!processor.avx2_fma) return "";
  const auto is_own = [&own](const char* name) { return own == name; };
  if (std::none_of(std::begin(kKernelsWithoutFma), std::end(kKernelsWithoutFma), is_own)) return "";
  return processor.avx512 ? "SkylakeX" : "Haswell";
}

std::string BetterKernel() {
  ProcessorFeatures processor;
#if defined(__x86_64__)
  processor.first_zen = __builtin_cpu_supports("fma4") != 0 || __builtin_cpu_is("znver1") != 0;
  processor.avx2_fma = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  processor.avx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512cd") != 0 &&
                     __builtin_cpu_supports("avx512bw") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
                     __builtin_cpu_supports("avx512vl") != 0;
#endif
  return ChooseKernel(processor, openblas_get_corename(), SlowKernel);
}

void RestartWithBlasSetUp(char** argv) {
  const char* threads = std::getenv(kThreads);
  const bool one_thread = threads != nullptr && std::strcmp(threads, "1") == 0;
  const std::string better = std::getenv(kKernel) == nullptr ? BetterKernel() : "";
  if (one_thread && better.empty()) return;
  UseOneBlasThread();  // also where the program cannot be executed again: at least no product uses them
  if (!better.empty()) setenv(kKernel, better.c_str(), /*overwrite=*/1);
  setenv(kThreads, "1", /*overwrite=*/1);
  // By its path, so that lists of processes show the program's name.
  std::error_code error;
  const std::string self = std::filesystem::read_symlink("/proc/self/exe", error).string();
  execv(error ? "/proc/self/exe" : self.c_str(), argv);
}

}  // namespace dbr
