#include "nn/blas_setup.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace dbr
