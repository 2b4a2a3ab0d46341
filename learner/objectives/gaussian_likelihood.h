// Fits a tanh-Gaussian policy to the actions of data by maximum likelihood.
#pragma once

#include "core/batch.h"
#include "learner/training/trained_network.h"
#include "nn/gaussian_head.h"
#include "nn/tanh_gaussian.h"

namespace dbr {

// Holds the policy's head from its newest use and workspaces, which are reused from batch to batch. One
// thread at a time.
template <class Scalar>
class GaussianLikelihood {
 public:
  explicit GaussianLikelihood(const LogStdLimits& limits) : limits_(limits) {}

  // Makes one step of `network` on the mean over the batch of -w log p(a|s). The weights [n] are constants;
  // null means that all are 1. Keeps the loss. Does nothing on an empty batch.
  void Fit(const BasicBatch<Scalar>& batch, const VectorX<Scalar>* weights, TrainedNetwork<Scalar>* network) {
    if (batch.size() == 0) return;
    Forward(batch.observations, network);
    Step(batch, weights, network);
  }

  // The two halves of Fit, for weights that depend on the policy: Forward evaluates it, and Step makes the
  // step from there.
  const GaussianHead<Scalar>& Forward(const MatrixX<Scalar>& observations, TrainedNetwork<Scalar>* network) {
    head_.Split(network->Forward(observations), limits_);
    return head_;
  }
  void Step(const BasicBatch<Scalar>& batch, const VectorX<Scalar>* weights,
            TrainedNetwork<Scalar>* network) {
    loss_ = Loss(batch.actions, weights, &d_output_);
    network->Step(batch.observations, d_output_);
  }

  // Evaluates the policy at `observations` without a gradient. The result is valid until the next call.
  const GaussianHead<Scalar>& At(const MatrixX<Scalar>& observations, TrainedNetwork<Scalar>* network) {
    head_.Split(network->Evaluate(observations), limits_);
    return head_;
  }

  const GaussianHead<Scalar>& head() const { return head_; }
  // [n] The log-likelihood of each action in the newest Step, from before the step.
  const VectorX<Scalar>& log_prob() const { return log_prob_; }
  Scalar loss() const { return loss_; }  // the loss of the newest Step

 private:
  Scalar Loss(const MatrixX<Scalar>& actions, const VectorX<Scalar>* weights, MatrixX<Scalar>* d_output) {
    TanhLogProb<Scalar>(head_.view(), actions, &log_prob_, &gradient_);
    const Scalar each = -1 / static_cast<Scalar>(actions.cols());
    gradient_.mean *= each;
    gradient_.log_std *= each;
    if (weights != nullptr) {
      gradient_.mean.array().rowwise() *= weights->array().transpose();
      gradient_.log_std.array().rowwise() *= weights->array().transpose();
    }
    head_.Join(gradient_, d_output);
    return each * (weights != nullptr ? weights->dot(log_prob_) : log_prob_.sum());
  }

  const LogStdLimits limits_;
  GaussianHead<Scalar> head_;
  VectorX<Scalar> log_prob_;  // [n]
  GaussianGradient<Scalar> gradient_;
  MatrixX<Scalar> d_output_;  // [2 * dimensions x n]
  Scalar loss_ = 0;
};

}  // namespace dbr
