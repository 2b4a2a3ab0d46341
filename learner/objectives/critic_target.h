// The target that critics regress on.
#pragma once

#include "core/batch.h"

namespace dbr {

// Sets `target` [n] to y = reward_scale * r + discount * V'(s'). next_value [n] is V'(s') and may be `target`
// itself.
template <class Scalar>
void CriticTarget(const BasicBatch<Scalar>& batch, double reward_scale, const VectorX<Scalar>& next_value,
                  VectorX<Scalar>* target) {
  *target = static_cast<Scalar>(reward_scale) * batch.rewards + batch.discounts.cwiseProduct(next_value);
}

}  // namespace dbr
