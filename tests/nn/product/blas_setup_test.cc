#include "nn/product/blas_setup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <Eigen/Core>
#include <fstream>
#include <string>

namespace dbr {
namespace {

TEST(BlasSetUp, ThePlainProductIsAProduct) {
  const Eigen::MatrixXf a = Eigen::MatrixXf::Random(kTrialSize, kTrialSize);
  const Eigen::MatrixXf b = Eigen::MatrixXf::Random(kTrialSize, kTrialSize);
  Eigen::MatrixXf c(kTrialSize, kTrialSize);
  PlainProduct(a.data(), b.data(), c.data());
  const Eigen::MatrixXf expected = a * b;
  EXPECT_LT((c - expected).cwiseAbs().maxCoeff(), 1e-4f);
}

constexpr auto kFast = [] { return false; };
constexpr auto kSlow = [] { return true; };

// OpenBLAS takes the kernel named Prescott, for SSE3, where it does not know the processor's model.
TEST(BlasSetUp, AProcessorThatOpenBlasDoesNotKnowGetsAKernelForItsInstructions) {
  EXPECT_EQ(ChooseKernel({.avx512 = true, .avx2_fma = true}, "Prescott", kFast), "SkylakeX");
  EXPECT_EQ(ChooseKernel({.avx2_fma = true}, "Prescott", kFast), "Haswell");
  EXPECT_EQ(ChooseKernel({.avx2_fma = true}, "Sandybridge", kFast), "Haswell");
  EXPECT_EQ(ChooseKernel({}, "Prescott", kSlow), "");  // it knows no better instructions
}

TEST(BlasSetUp, AKernelForTheProcessorStays) {
  for (const char* own :
       {"Haswell", "Zen", "SkylakeX", "Cooperlake", "SapphireRapids", "Excavator", "ANewerOne"}) {
    EXPECT_EQ(ChooseKernel({.avx512 = true, .avx2_fma = true}, own, kSlow), "") << own;
  }
}

TEST(BlasSetUp, TheFirstZenGetsAnotherKernelWhereItsOwnIsSlow) {
  EXPECT_EQ(ChooseKernel({.avx2_fma = true, .first_zen = true}, "Zen", kSlow), "Excavator");
  EXPECT_EQ(ChooseKernel({.avx2_fma = true, .first_zen = true}, "Zen", kFast), "");
}

// The kernel must be one that the processor can execute.
TEST(BlasSetUp, TakesNoKernelWhoseInstructionsTheProcessorLacks) {
  std::ifstream cpuinfo("/proc/cpuinfo");
  std::string line, flags;
  while (std::getline(cpuinfo, line)) {
    if (line.rfind("flags", 0) == 0) flags = line + " ";
  }
  const std::string kernel = BetterKernel();
  if (kernel == "SkylakeX") EXPECT_THAT(flags, testing::HasSubstr(" avx512vl "));
  if (kernel == "Haswell") EXPECT_THAT(flags, testing::HasSubstr(" avx2 "));
}

TEST(BlasSetUp, TooLittleAddressSpaceIsFoundBeforeTheFirstProduct) {
  EXPECT_TRUE(CheckBlasMemory(1).ok());
  EXPECT_TRUE(CheckBlasMemory(0).ok());
  rlimit old_limit;
  ASSERT_EQ(getrlimit(RLIMIT_AS, &old_limit), 0);
  rlimit limit = old_limit;
  limit.rlim_cur = rlim_t{1} << 40;
  ASSERT_EQ(setrlimit(RLIMIT_AS, &limit), 0);
  const absl::Status status = CheckBlasMemory(1 << 20);
  EXPECT_EQ(setrlimit(RLIMIT_AS, &old_limit), 0);
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("ulimit -v"));
}

}  // namespace
}  // namespace dbr
