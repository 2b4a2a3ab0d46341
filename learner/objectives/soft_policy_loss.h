// The results of SAC's policy loss, over either kind of action.
#pragma once

namespace dbr {

template <class Scalar>
struct SoftPolicyLoss {
  Scalar loss = 0;
  Scalar value = 0;    // E[min_i Q_i(s, a)]
  Scalar entropy = 0;  // mean of -log pi(a|s), nats: exact over discrete actions, else estimated from draws
};

}  // namespace dbr
