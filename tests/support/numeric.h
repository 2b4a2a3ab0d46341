// Compares matrices, and gradients with central differences.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/batch.h"

namespace dbr {

// Returns nested lists [n][dimensions] as [dimensions x n], or [n][samples][dimensions] as
// [dimensions x n * samples].
inline MatrixX<double> ToMatrix(const nlohmann::json& rows) {
  if (rows[0][0].is_array()) {
    nlohmann::json flat = nlohmann::json::array();
    for (const nlohmann::json& group : rows) flat.insert(flat.end(), group.begin(), group.end());
    return ToMatrix(flat);
  }
  MatrixX<double> matrix(rows[0].size(), rows.size());
  for (std::size_t j = 0; j < rows.size(); ++j) {
    for (std::size_t i = 0; i < rows[j].size(); ++i) matrix(i, j) = rows[j][i].get<double>();
  }
  return matrix;
}

inline VectorX<double> ToVector(const nlohmann::json& values) {
  VectorX<double> vector(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) vector[i] = values[i].get<double>();
  return vector;
}

// `scale` is the tolerance relative to 1 + the largest entry.
inline void ExpectNear(const MatrixX<double>& found, const MatrixX<double>& expected, double scale = 1e-10) {
  ASSERT_EQ(found.rows(), expected.rows());
  ASSERT_EQ(found.cols(), expected.cols());
  EXPECT_TRUE(found.allFinite());
  const double tolerance = scale * (1 + expected.cwiseAbs().maxCoeff());
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), tolerance) << "found\n"
                                                                 << found << "\nexpected\n"
                                                                 << expected;
}

// Compares `gradient` with the central differences of `f` at `at`.
inline void ExpectIsGradient(const MatrixX<double>& gradient,
                             const std::function<double(const MatrixX<double>&)>& f,
                             const MatrixX<double>& at) {
  constexpr double kStep = 1e-6;
  MatrixX<double> differences(at.rows(), at.cols());
  MatrixX<double> moved = at;
  for (Eigen::Index i = 0; i < at.size(); ++i) {
    const double x = at.data()[i];
    moved.data()[i] = x + kStep;
    const double above = f(moved);
    moved.data()[i] = x - kStep;
    const double below = f(moved);
    moved.data()[i] = x;
    differences.data()[i] = (above - below) / (2 * kStep);
  }
  ExpectNear(gradient, differences, 1e-7);
}

}  // namespace dbr
