// BEAR's behaviour model over continuous actions: a conditional VAE with its optimizers.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "core/rng.h"
#include "learner/training/trained_network.h"
#include "nn/cvae.h"

namespace dbr {

// Owns the encoder and the decoder. One thread at a time.
template <class Scalar>
class BehaviorVae {
 public:
  BehaviorVae(const CvaeShape& shape, const TrainingOptions& options, Rng& rng)
      : encoder_(shape.encoder, options, rng), decoder_(shape.decoder, options, rng), cvae_(shape) {}

  const CvaeShape& shape() const { return cvae_.shape(); }

  // Makes one step of both networks on the VAE's loss (nn/cvae.h). Returns the loss from before the step.
  CvaeLoss<Scalar> Fit(const CvaeBatch<Scalar>& batch, Scalar kl_weight) {
    const CvaeLoss<Scalar> loss = cvae_.Gradient({encoder_.online(), decoder_.online()}, batch, kl_weight,
                                                 &encoder_.gradient(), &decoder_.gradient());
    encoder_.ApplyGradient();
    decoder_.ApplyGradient();
    return loss;
  }

  // Returns actions before their tanh at n observations [dimensions x n * count]. Sample i of state s is
  // column s * count + i. noise [latent x n * count] is standard normal. Its entries are clipped to +-limit,
  // which keeps the latents where the decoder has seen data. The result is valid until the next call.
  const MatrixX<Scalar>& Sample(const MatrixX<Scalar>& observations, const MatrixX<Scalar>& noise,
                                Scalar limit) {
    latents_ = noise.cwiseMax(-limit).cwiseMin(limit);
    return cvae_.Decode(decoder_.online(), observations, latents_);
  }

  void set_learning_rate(double learning_rate) {
    encoder_.set_learning_rate(learning_rate);
    decoder_.set_learning_rate(learning_rate);
  }

  void Save(TensorFile* file) const {
    encoder_.Save("vae.encoder", file);
    decoder_.Save("vae.decoder", file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = encoder_.Load("vae.encoder", file);
    status.Update(decoder_.Load("vae.decoder", file));
    return status;
  }

 private:
  TrainedNetwork<Scalar> encoder_, decoder_;
  Cvae<Scalar> cvae_;
  MatrixX<Scalar> latents_;  // [latent x n * count]
};

}  // namespace dbr
