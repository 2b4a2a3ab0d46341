// Draws actions from a tanh-Gaussian policy at every state of a batch, and takes gradients back through the
// draws.
#pragma once

#include "core/batch.h"
#include "nn/gaussian_head.h"
#include "nn/normal_noise.h"
#include "nn/tanh_gaussian.h"

namespace dbr {

// `count` draws for each of n states: draw k of state j is column k * n + j. Reused from batch to batch. One
// thread at a time.
template <class Scalar>
class SampledActions {
 public:
  // Draws actions with their log-probabilities. noise [dimensions x count * n].
  void Draw(const GaussianHead<Scalar>& head, const MatrixX<Scalar>& noise) {
    Repeat(head, noise);
    SampleTanhGaussian<Scalar>({mean_, log_std_}, noise_, &sample_);
  }
  // Draws actions without log-probabilities.
  void DrawActions(const GaussianHead<Scalar>& head, const MatrixX<Scalar>& noise) {
    Repeat(head, noise);
    SampleTanhActions<Scalar>({mean_, log_std_}, noise_, &sample_);
  }

  Eigen::Index count() const { return count_; }
  const TanhSample<Scalar>& sample() const { return sample_; }

  // Returns the critics' input [observation + dimensions x count * n]: the observations above the actions.
  const MatrixX<Scalar>& CriticInput(const MatrixX<Scalar>& observations) {
    input_.resize(observations.rows() + sample_.action.rows(), count_ * n_);
    for (Eigen::Index k = 0; k < count_; ++k) {
      input_.block(0, k * n_, observations.rows(), n_) = observations;
    }
    input_.bottomRows(sample_.action.rows()) = sample_.action;
    return input_;
  }

  // Adds to `gradient` [dimensions x n] the gradient that flows back from the actions [dimensions x count *
  // n] and from the log-probabilities [count * n].
  void Backprop(const MatrixX<Scalar>& d_action, const VectorX<Scalar>& d_log_prob,
                GaussianGradient<Scalar>* gradient) {
    BackpropTanhSample<Scalar>({mean_, log_std_}, noise_, sample_, {d_action, d_log_prob}, &each_);
    for (Eigen::Index k = 0; k < count_; ++k) {
      gradient->mean += each_.mean.middleCols(k * n_, n_);
      gradient->log_std += each_.log_std.middleCols(k * n_, n_);
    }
  }

 private:
  void Repeat(const GaussianHead<Scalar>& head, const MatrixX<Scalar>& noise) {
    n_ = head.mean().cols();
    count_ = noise.cols() / n_;
    noise_ = noise;
    mean_ = head.mean().replicate(1, count_);
    log_std_ = head.log_std().replicate(1, count_);
  }

  Eigen::Index n_ = 0, count_ = 0;
  // noise_, mean_ and log_std_ [dimensions x count * n], input_ [observation + dimensions x count * n].
  MatrixX<Scalar> noise_, mean_, log_std_, input_;
  TanhSample<Scalar> sample_;
  GaussianGradient<Scalar> each_;
};

}  // namespace dbr
