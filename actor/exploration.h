// Random actions among the chosen ones, more of them in some environments than in others.
#pragma once

#include <vector>

#include "core/batch.h"
#include "core/rng.h"
#include "core/space.h"

namespace dbr {

// Environment i of n has its own share epsilon^(1 + ladder * i / (n - 1)) of uniformly random actions: with
// ladder 0 all have epsilon, else the last ones nearly none (the ladder of Ape-X, Horgan et al. 2018). One
// thread at a time.
class Exploration {
 public:
  Exploration(const ActionSpace& actions, double epsilon, double ladder, int n);

  // Replaces columns of `actions` [width x n] by uniformly random legal ones, each with its environment's
  // share; a continuous action by one uniform in [-1, 1]^size. masks [mask width x n]. Returns how many it
  // replaced.
  int Apply(const MatrixX<float>& masks, Rng& rng, MatrixX<float>* actions) const;

  const std::vector<double>& shares() const { return shares_; }  // [n]

 private:
  ActionSpace space_;
  std::vector<double> shares_;
};

}  // namespace dbr
