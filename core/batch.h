// A batch of transitions for an update: one column of a matrix for each sample.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/columns.h"
#include "core/transition.h"

namespace dbr {

template <class Scalar>
using MatrixX = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
template <class Scalar>
using VectorX = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

// The columns of core/columns.h, each a matrix [width x n] or, where a sample has one float at most, a vector
// [n]:
//
//   observations, next_observations   [observation x n]
//   actions                           [action width x n]   an index, or the dimensions
//   masks, next_masks                 [actions x n]        [0 x n] for a continuous space
//   rewards, discounts                [n]
//   returns                           [n]                  Monte-Carlo; [0] where the layout has none
//   next_actions                      [action width x n]   [0 x n] where the layout has none
//
// Plain values, thread-compatible; the caller owns a batch and refills it, so that an update allocates
// nothing once sizes have settled.
template <class Scalar>
struct BasicBatch : ColumnSet<MatrixX<Scalar>, VectorX<Scalar>> {
  std::vector<std::uint64_t> keys;  // [n] of the replay server; empty where the batch has none

  Eigen::Index size() const { return this->observations.cols(); }

  // Sets every column's size; contents are unspecified afterwards. `with_keys` sizes `keys` too.
  void Resize(const TransitionLayout& layout, Eigen::Index n, bool with_keys) {
    ForEachColumn([n](const ColumnPlace& place, auto& column) { ResizeColumn(place.width, n, &column); },
                  layout.columns(), *this);
    keys.resize(with_keys ? static_cast<std::size_t>(n) : 0);
  }

 private:
  static void ResizeColumn(int width, Eigen::Index n, MatrixX<Scalar>* column) { column->resize(width, n); }
  static void ResizeColumn(int width, Eigen::Index n, VectorX<Scalar>* column) { column->resize(width * n); }
};

using Batch = BasicBatch<float>;

}  // namespace dbr
