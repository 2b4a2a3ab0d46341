// The figures of SAC's policy loss, whatever the actions.
#pragma once

namespace dbr {

template <class Scalar>
struct SoftPolicyLoss {
  Scalar loss = 0;
  Scalar value = 0;    // E[min_i Q_i(s, a)]
  Scalar entropy = 0;  // mean of -log pi(a|s), nats: exact over discrete actions, else over the draws
};

}  // namespace dbr
