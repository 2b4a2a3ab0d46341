#include "nn/blas_setup.h"

#include <gtest/gtest.h>

#include <Eigen/Core>

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

}  // namespace
}  // namespace dbr
