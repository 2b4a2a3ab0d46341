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

// On a busy machine SlowKernel may take its own timing's noise for a slow kernel, on any processor.
TEST(BlasSetUp, TakesAnotherKernelOnlyWhereItsInstructionsRun) {
  std::ifstream cpuinfo("/proc/cpuinfo");
  std::string line, vendor, flags;
  while (std::getline(cpuinfo, line)) {
    if (line.rfind("vendor_id", 0) == 0) vendor = line;
    if (line.rfind("flags", 0) == 0) flags = line + " ";
  }
  if (vendor.find("AuthenticAMD") == std::string::npos) {
    EXPECT_FALSE(RunsOtherKernel()) << vendor;
  } else if (flags.find(" fma4 ") != std::string::npos) {
    EXPECT_TRUE(RunsOtherKernel());
  }
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
