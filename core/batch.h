// A batch of transitions for an update: one column for each sample.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/transition.h"

namespace dbr {

template <class Scalar>
using MatrixX = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
template <class Scalar>
using VectorX = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

// Plain values; the caller owns a batch and refills it, so that an update allocates nothing once sizes have
// settled.
template <class Scalar>
struct BasicBatch {
  MatrixX<Scalar> observations;       // [observation x n]
  MatrixX<Scalar> actions;            // [action width x n]: an index, or the dimensions
  MatrixX<Scalar> masks;              // [actions x n] for a discrete space, else [0 x n]
  VectorX<Scalar> rewards;            // [n]
  VectorX<Scalar> discounts;          // [n]
  VectorX<Scalar> returns;            // [n] Monte-Carlo returns, or [0] where the layout has none
  MatrixX<Scalar> next_observations;  // [observation x n]
  MatrixX<Scalar> next_masks;         // [actions x n] or [0 x n]
  std::vector<std::uint64_t> keys;    // [n] of the replay server; empty where the batch has none

  Eigen::Index size() const { return observations.cols(); }

  // Sets every column's size; contents are unspecified afterwards. `with_keys` sizes `keys` too.
  void Resize(const TransitionLayout& layout, Eigen::Index n, bool with_keys) {
    observations.resize(layout.observation_width, n);
    actions.resize(layout.action_width, n);
    masks.resize(layout.mask_width, n);
    rewards.resize(n);
    discounts.resize(n);
    returns.resize(layout.return_width * n);
    next_observations.resize(layout.observation_width, n);
    next_masks.resize(layout.mask_width, n);
    keys.resize(with_keys ? static_cast<std::size_t>(n) : 0);
  }
};

using Batch = BasicBatch<float>;

}  // namespace dbr
