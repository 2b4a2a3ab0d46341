// Fitting a tanh-Gaussian policy to the actions of data by maximum likelihood.
#pragma once

#include "core/batch.h"
#include "learner/training/trained_network.h"
#include "nn/gaussian_head.h"
#include "nn/tanh_gaussian.h"

namespace dbr {

// The policy at the states of its newest use, with workspaces; reused from batch to batch.
template <class Scalar>
class GaussianLikelihood {
 public:
  explicit GaussianLikelihood(const LogStdLimits& limits) : limits_(limits) {}

  // One step on the mean over the batch of -w log p(a|s); weights [n] are constants, null: all 1. Keeps the
  // loss, and does nothing on an empty batch.
  void Fit(const BasicBatch<Scalar>& batch, const VectorX<Scalar>* weights, TrainedNetwork<Scalar>* network) {
    if (batch.size() == 0) return;
    Forward(batch.observations, network);
    Step(batch, weights, network);
  }

  // The two halves of Fit, for weights that depend on the policy: its evaluation, and the step from it.
  const GaussianHead<Scalar>& Forward(const MatrixX<Scalar>& observations, TrainedNetwork<Scalar>* network) {
    head_.Split(network->Forward(observations), limits_);
    return head_;
  }
  void Step(const BasicBatch<Scalar>& batch, const VectorX<Scalar>* weights,
            TrainedNetwork<Scalar>* network) {
    loss_ = Loss(batch.actions, weights, &d_output_);
    network->Step(batch.observations, d_output_);
  }

  // Evaluates the policy at `observations`; no gradient is taken.
  const GaussianHead<Scalar>& At(const MatrixX<Scalar>& observations, TrainedNetwork<Scalar>* network) {
    head_.Split(network->Evaluate(observations), limits_);
    return head_;
  }

  const GaussianHead<Scalar>& head() const { return head_; }
  const VectorX<Scalar>& log_prob() const {
    return log_prob_;
  }                                      // [n] of the newest Fit, from before its step
  Scalar loss() const { return loss_; }  // of the newest Fit

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
  VectorX<Scalar> log_prob_;
  GaussianGradient<Scalar> gradient_;
  MatrixX<Scalar> d_output_;
  Scalar loss_ = 0;
};

}  // namespace dbr
