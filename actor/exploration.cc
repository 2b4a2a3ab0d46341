#include "actor/exploration.h"

#include <cmath>

namespace dbr {
namespace {

// The index of a uniformly drawn legal action; -1 where none is legal.
int DrawLegal(const MatrixX<float>& masks, int column, Rng& rng) {
  int legal = 0;
  for (int k = 0; k < masks.rows(); ++k) legal += masks(k, column) > 0;
  if (legal == 0) return -1;
  int remaining = static_cast<int>(rng.Below(legal));
  int k = 0;
  while (masks(k, column) <= 0 || remaining-- > 0) ++k;
  return k;
}

}  // namespace

Exploration::Exploration(const ActionSpace& actions, double epsilon, double ladder, int n)
    : space_(actions), shares_(n) {
  for (int i = 0; i < n; ++i) {
    const double rung = n > 1 ? static_cast<double>(i) / (n - 1) : 0.0;
    shares_[i] = std::pow(epsilon, 1 + ladder * rung);
  }
}

int Exploration::Apply(const MatrixX<float>& masks, Rng& rng, MatrixX<float>* actions) const {
  int replaced = 0;
  for (int i = 0; i < static_cast<int>(shares_.size()); ++i) {
    if (shares_[i] <= 0 || rng.Uniform() >= shares_[i]) continue;
    ++replaced;
    if (space_.discrete()) {
      (*actions)(0, i) = static_cast<float>(DrawLegal(masks, i, rng));
    } else {
      for (int k = 0; k < space_.size; ++k) (*actions)(k, i) = static_cast<float>(2 * rng.Uniform() - 1);
    }
  }
  return replaced;
}

}  // namespace dbr
