// The Munchausen term (Vieillard, Pietquin, Geist 2020, "Munchausen Reinforcement Learning", equation 1).
#pragma once

#include "core/batch.h"

namespace dbr {

// Sets `bonus` [n] to weight * log beta+(a|s), with the log clipped to [-1, 0]. The rewards are raised by it.
// log_prob [n] is log beta+(a|s): the DBR paper's section on ablations puts it in the place of the
// log-policy.
template <class Scalar>
void MunchausenBonus(double weight, const VectorX<Scalar>& log_prob, VectorX<Scalar>* bonus) {
  *bonus = static_cast<Scalar>(weight) * log_prob.cwiseMax(Scalar{-1}).cwiseMin(Scalar{0});
}

}  // namespace dbr
