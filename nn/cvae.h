// A conditional variational autoencoder (VAE) of actions given observations: the behaviour model of BEAR
// (Kumar et al. 2019) over continuous actions.
#pragma once

#include <vector>

#include "nn/gaussian_head.h"
#include "nn/mlp.h"

namespace dbr {

// Limits of the latent's log-std, as in BEAR's code.
inline constexpr LogStdLimits kLatentLogStd{-4, 15};

struct CvaeShape {
  // `hidden_sizes` are those of the encoder and of the decoder alike.
  CvaeShape(int observation_size, int action_size, const std::vector<int>& hidden_sizes);

  int latent_size;   // twice the number of action dimensions
  MlpShape encoder;  // [observation; action] -> means and log-stds of the latent [2 * latent]
  MlpShape decoder;  // [observation; latent] -> the action before its tanh

  // Useful floating-point operations for n samples (nn/mlp.h).
  double GradientFlops(Eigen::Index n) const;
  double DecodeFlops(Eigen::Index n) const { return decoder.ForwardFlops(n); }
};

// The caller's parameters of both networks.
template <class Scalar>
struct CvaeParameters {
  MlpParameters<Scalar> encoder;
  MlpParameters<Scalar> decoder;
};

// What a gradient is taken on.
template <class Scalar>
struct CvaeBatch {
  const MatrixX<Scalar>& observations;  // [observation x n]
  const MatrixX<Scalar>& actions;       // [dimensions x n]
  const MatrixX<Scalar>& noise;         // [latent x n], standard normal
};

// The loss of a batch and its two terms.
template <class Scalar>
struct CvaeLoss {
  Scalar loss = 0;            // reconstruction + kl_weight * kl
  Scalar reconstruction = 0;  // mean over batch and dimensions of (tanh(decoded) - action)^2
  Scalar kl = 0;              // mean over batch and latent dimensions of KL to N(0, 1), nats
};

// The VAE's functions with workspaces, reused from batch to batch; the parameters are the caller's. Float and
// double; one thread at a time.
template <class Scalar>
class Cvae {
 public:
  explicit Cvae(const CvaeShape& shape) : shape_(shape) {}

  const CvaeShape& shape() const { return shape_; }

  // The loss with the latent drawn as mean + std * noise, and its gradients with respect to the parameters of
  // both networks, which are overwritten. Each network is passed once in each direction: the encoder's
  // gradient comes through the decoder's deltas.
  CvaeLoss<Scalar> Gradient(const CvaeParameters<Scalar>& parameters, const CvaeBatch<Scalar>& batch,
                            Scalar kl_weight, VectorX<Scalar>* d_encoder, VectorX<Scalar>* d_decoder);

  // [dimensions x n * count] actions before their tanh, decoded from latents [latent x n * count] at n
  // observations [observation x n]: sample i of state s is column s * count + i. Valid until the next call.
  const MatrixX<Scalar>& Decode(const MlpParameters<Scalar>& decoder, const MatrixX<Scalar>& observations,
                                const MatrixX<Scalar>& latents);

 private:
  // Sets d_decoded_ and returns the reconstruction's loss.
  Scalar Reconstruct(const MatrixX<Scalar>& decoded, const MatrixX<Scalar>& actions);
  // Sets the latent's gradient, the part that comes through d_decoder_input_ included, and returns the mean
  // KL.
  Scalar Regularize(Scalar kl_weight);

  CvaeShape shape_;
  GaussianHead<Scalar> latent_;
  GaussianGradient<Scalar> d_latent_;
  MlpActivations<Scalar> encoder_, decoder_, sampling_;
  MatrixX<Scalar> encoder_input_, decoder_input_, sampling_input_;
  MatrixX<Scalar> spread_;  // [latent x n] std * noise
  MatrixX<Scalar> prior_;   // [latent x n] zeros: the means and log-stds of N(0, 1)
  MatrixX<Scalar> action_, d_decoded_, d_decoder_input_, d_encoded_;
  VectorX<Scalar> kl_;
};

}  // namespace dbr
