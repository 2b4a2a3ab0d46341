#include "nn/cvae.h"

#include "core/check.h"
#include "nn/divergence.h"

namespace dbr {

CvaeShape::CvaeShape(int observation_size, int action_size, const std::vector<int>& hidden_sizes)
    : latent_size(2 * action_size),
      encoder(observation_size + action_size, hidden_sizes, 2 * latent_size),
      decoder(observation_size + latent_size, hidden_sizes, action_size) {}

double CvaeShape::GradientFlops(Eigen::Index n) const {
  const double decoder_input = 2.0 * static_cast<double>(n) * decoder.in(0) * decoder.out(0);
  return encoder.ForwardFlops(n) + encoder.ParameterGradientFlops(n) + decoder.ForwardFlops(n) +
         decoder.ParameterGradientFlops(n) + decoder_input;
}

template <class Scalar>
CvaeLoss<Scalar> Cvae<Scalar>::Gradient(const CvaeParameters<Scalar>& parameters,
                                        const CvaeBatch<Scalar>& batch, Scalar kl_weight,
                                        VectorX<Scalar>* d_encoder, VectorX<Scalar>* d_decoder) {
  DBR_CHECK(batch.noise.rows() == shape_.latent_size && batch.noise.cols() == batch.observations.cols());
  encoder_input_.resize(shape_.encoder.input_size(), batch.observations.cols());
  encoder_input_ << batch.observations, batch.actions;
  latent_.Split(MlpForward<Scalar>(shape_.encoder, parameters.encoder, encoder_input_, &encoder_),
                kLatentLogStd);
  spread_ = (latent_.log_std().array().exp() * batch.noise.array()).matrix();
  decoder_input_.resize(shape_.decoder.input_size(), batch.observations.cols());
  decoder_input_ << batch.observations, latent_.mean() + spread_;
  const MatrixX<Scalar>& decoded =
      MlpForward<Scalar>(shape_.decoder, parameters.decoder, decoder_input_, &decoder_);

  CvaeLoss<Scalar> result;
  result.reconstruction = Reconstruct(decoded, batch.actions);
  MlpParameterGradient<Scalar>(parameters.decoder, decoder_input_, d_decoded_, &decoder_, d_decoder);
  MlpInputGradientOfDeltas<Scalar>(parameters.decoder, d_decoded_, &decoder_, &d_decoder_input_);
  result.kl = Regularize(kl_weight);
  latent_.Join(d_latent_, &d_encoded_);
  MlpParameterGradient<Scalar>(parameters.encoder, encoder_input_, d_encoded_, &encoder_, d_encoder);
  result.loss = result.reconstruction + kl_weight * result.kl;
  return result;
}

template <class Scalar>
Scalar Cvae<Scalar>::Reconstruct(const MatrixX<Scalar>& decoded, const MatrixX<Scalar>& actions) {
  const auto size = static_cast<Scalar>(actions.size());
  action_ = decoded.array().tanh().matrix();
  d_decoded_ = action_ - actions;
  const Scalar loss = d_decoded_.squaredNorm() / size;
  d_decoded_.array() *= (2 / size) * (1 - action_.array().square());
  return loss;
}

template <class Scalar>
Scalar Cvae<Scalar>::Regularize(Scalar kl_weight) {
  prior_.setZero(spread_.rows(), spread_.cols());
  GaussianKl<Scalar>(latent_.view(), {prior_, prior_}, &kl_, &d_latent_, nullptr);
  const auto size = static_cast<Scalar>(spread_.size());
  d_latent_.mean *= kl_weight / size;
  d_latent_.log_std *= kl_weight / size;
  d_latent_.mean += d_decoder_input_.bottomRows(spread_.rows());
  d_latent_.log_std += d_decoder_input_.bottomRows(spread_.rows()).cwiseProduct(spread_);
  return kl_.sum() / size;
}

template <class Scalar>
const MatrixX<Scalar>& Cvae<Scalar>::Decode(const MlpParameters<Scalar>& decoder,
                                            const MatrixX<Scalar>& observations,
                                            const MatrixX<Scalar>& latents) {
  DBR_CHECK(latents.rows() == shape_.latent_size && latents.cols() % observations.cols() == 0);
  const Eigen::Index count = latents.cols() / observations.cols();
  sampling_input_.resize(shape_.decoder.input_size(), latents.cols());
  for (Eigen::Index j = 0; j < latents.cols(); ++j) {
    sampling_input_.col(j) << observations.col(j / count), latents.col(j);
  }
  return MlpForward<Scalar>(shape_.decoder, decoder, sampling_input_, &sampling_);
}

template class Cvae<float>;
template class Cvae<double>;

}  // namespace dbr
