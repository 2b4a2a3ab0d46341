// Fits a policy over discrete actions to the actions of data by maximum likelihood.
#pragma once

#include "core/batch.h"
#include "learner/training/trained_network.h"
#include "nn/categorical.h"

namespace dbr {

// Holds the policy's distribution from its newest use and workspaces, which are reused from batch to batch.
// One thread at a time.
template <class Scalar>
class CategoricalLikelihood {
 public:
  // Makes one step of `network` on the mean over the batch of -w log p(a|s). The weights [n] are constants;
  // null means that all are 1. Keeps the loss and the distribution from before the step. Does nothing on an
  // empty batch.
  void Fit(const BasicBatch<Scalar>& batch, const VectorX<Scalar>* weights, TrainedNetwork<Scalar>* network) {
    if (batch.size() == 0) return;
    MaskedSoftmax<Scalar>(network->Forward(batch.observations), batch.masks, &distribution_);
    loss_ = NegativeLogLikelihood<Scalar>(distribution_, batch.actions, &d_logits_, weights);
    network->Step(batch.observations, d_logits_);
  }

  // Evaluates the policy without a gradient. The result is valid until the next call of Fit or At.
  const Categorical<Scalar>& At(const MatrixX<Scalar>& observations, const MatrixX<Scalar>& masks,
                                TrainedNetwork<Scalar>* network) {
    MaskedSoftmax<Scalar>(network->Evaluate(observations), masks, &distribution_);
    return distribution_;
  }

  const Categorical<Scalar>& distribution() const { return distribution_; }
  Scalar loss() const { return loss_; }  // the loss of the newest Fit

 private:
  Categorical<Scalar> distribution_;
  MatrixX<Scalar> d_logits_;  // [actions x n]
  Scalar loss_ = 0;
};

}  // namespace dbr
