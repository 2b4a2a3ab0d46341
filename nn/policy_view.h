// What the networks of a policy over discrete actions say, for those who look into it.
#pragma once

#include "core/batch.h"

namespace dbr {

// The outputs for n observations, [actions x n] each; empty where the policy lacks the network. Probabilities
// of illegal actions are 0; Q of illegal actions is meaningless. A plain value, reused from batch to batch.
struct PolicyView {
  MatrixX<float> policy;      // probabilities pi(a|s)
  MatrixX<float> beta_plus;   // probabilities of the behaviour in D+
  MatrixX<float> beta_minus;  // probabilities of the behaviour in D-
  MatrixX<float> beta;        // probabilities of an algorithm's one behaviour policy
  MatrixX<float> q;           // the smaller one of the twin critics
};

}  // namespace dbr
