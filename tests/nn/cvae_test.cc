// Tests the conditional VAE: its gradients against central differences in double, its loss against the
// formula, and the order of its samples.
#include "nn/cvae.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "tests/support/numeric.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

constexpr int kObservation = 3, kDimensions = 2, kLatent = 4, kStates = 5;
constexpr double kKlWeight = 0.5;

class CvaeTest : public testing::Test {
 protected:
  Matrix Normal(Eigen::Index rows, Eigen::Index cols) {
    return Matrix::NullaryExpr(rows, cols, [&] { return rng_.Normal(); });
  }
  CvaeLoss<double> Loss(const Vector& encoder, const Vector& decoder) {
    return cvae_.Gradient({encoder, decoder}, {observations_, actions_, noise_}, kKlWeight, &d_encoder_,
                          &d_decoder_);
  }
  // Makes an encoder whose latent is the same for every input.
  Vector ConstantEncoder(double mean, double log_std) const {
    Vector encoder = Vector::Zero(shape_.encoder.parameter_count());
    encoder.tail(2 * kLatent).head(kLatent).setConstant(mean);
    encoder.tail(kLatent).setConstant(log_std);
    return encoder;
  }

  Rng rng_{21};
  CvaeShape shape_{kObservation, kDimensions, {6, 5}};
  Cvae<double> cvae_{shape_};
  const Matrix observations_ = Normal(kObservation, kStates);
  const Matrix actions_ = Normal(kDimensions, kStates).array().tanh();
  const Matrix noise_ = Normal(kLatent, kStates);
  const Vector encoder_ = InitialParameters<double>(shape_.encoder, rng_);
  const Vector decoder_ = InitialParameters<double>(shape_.decoder, rng_);
  Vector d_encoder_, d_decoder_;
};

TEST_F(CvaeTest, GradientsOfBothNetworksMatchDifferences) {
  const CvaeLoss<double> loss = Loss(encoder_, decoder_);
  EXPECT_NEAR(loss.loss, loss.reconstruction + kKlWeight * loss.kl, 1e-15);
  const Vector encoder = d_encoder_, decoder = d_decoder_;
  ExpectIsGradient(
      encoder, [&](const Matrix& at) { return Loss(at, decoder_).loss; }, encoder_);
  ExpectIsGradient(
      decoder, [&](const Matrix& at) { return Loss(encoder_, at).loss; }, decoder_);
}

TEST_F(CvaeTest, AveragesOverBatchAndDimensions) {
  const Vector silent = Vector::Zero(shape_.decoder.parameter_count());
  const CvaeLoss<double> loss = Loss(ConstantEncoder(0.7, -0.4), silent);
  EXPECT_NEAR(loss.reconstruction, actions_.squaredNorm() / (kStates * kDimensions), 1e-12);
  EXPECT_NEAR(loss.kl, (0.7 * 0.7 + std::exp(-0.8) - 1) / 2 + 0.4, 1e-12);
}

TEST_F(CvaeTest, ClipsTheLatentsLogStd) {
  EXPECT_NEAR(Loss(ConstantEncoder(0, -9), decoder_).kl, (std::exp(-8.0) - 1) / 2 + 4, 1e-12);
  EXPECT_FALSE(d_encoder_.tail(kLatent).isZero(0));  // the KL leads it back between the limits
  EXPECT_NEAR(Loss(ConstantEncoder(0, -3), decoder_).kl, (std::exp(-6.0) - 1) / 2 + 3, 1e-12);
  EXPECT_FALSE(d_encoder_.tail(kLatent).isZero(0));
}

TEST_F(CvaeTest, TheNoiseMovesTheLatentByItsStd) {
  // With noise 0 the decoder sees the mean, so another log-std does not change the reconstruction.
  const Matrix none = Matrix::Zero(kLatent, kStates);
  const auto reconstruction = [&](double log_std, const Matrix& noise) {
    return cvae_
        .Gradient({ConstantEncoder(0.3, log_std), decoder_}, {observations_, actions_, noise}, kKlWeight,
                  &d_encoder_, &d_decoder_)
        .reconstruction;
  };
  EXPECT_EQ(reconstruction(-1, none), reconstruction(1, none));
  EXPECT_NE(reconstruction(-1, noise_), reconstruction(1, noise_));
}

TEST_F(CvaeTest, SamplesOfAStateStandSideBySide) {
  constexpr int kSamples = 3;
  const Matrix latents = Normal(kLatent, kStates * kSamples);
  const Matrix all = cvae_.Decode(decoder_, observations_, latents);
  ASSERT_EQ(all.cols(), kStates * kSamples);
  for (int state = 0; state < kStates; ++state) {
    for (int i = 0; i < kSamples; ++i) {
      const int column = state * kSamples + i;
      const Matrix one = cvae_.Decode(decoder_, observations_.col(state), latents.col(column));
      ExpectNear(one, all.col(column));
    }
  }
}

TEST_F(CvaeTest, CountsTheDecodersWayBackToItsInput) {
  const double decoder_input = 2.0 * kStates * (kObservation + kLatent) * 6;
  EXPECT_EQ(shape_.GradientFlops(kStates),
            shape_.encoder.ForwardFlops(kStates) + shape_.encoder.ParameterGradientFlops(kStates) +
                shape_.decoder.ForwardFlops(kStates) + shape_.decoder.ParameterGradientFlops(kStates) +
                decoder_input);
}

}  // namespace
}  // namespace dbr
