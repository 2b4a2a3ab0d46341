#include "nn/layer_norm.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <type_traits>

namespace dbr {
namespace {

constexpr double kEpsilon = 1e-5;  // is added to the variance

// The sums of a - a0 and of (a - a0) (b - b0) over the entries of two columns a and b.
template <class Scalar>
struct ShiftedSums {
  Scalar plain;
  Scalar product;
};

// Adds up n entries in one pass over memory.
template <class Scalar>
ShiftedSums<Scalar> SumShifted(const Scalar* a, Scalar a0, const Scalar* b, Scalar b0, Eigen::Index n) {
  constexpr int kGroup = 64 / sizeof(Scalar);
  using Group = Eigen::Array<Scalar, kGroup, 1>;
  Group plain = Group::Zero(), product = Group::Zero();
  Eigen::Index i = 0;
  for (; i + kGroup <= n; i += kGroup) {
    const Group x = Eigen::Map<const Group>(a + i) - a0;
    plain += x;
    product += x * (Eigen::Map<const Group>(b + i) - b0);
  }
  ShiftedSums<Scalar> sums{plain.sum(), product.sum()};
  for (; i < n; ++i) {
    sums.plain += a[i] - a0;
    sums.product += (a[i] - a0) * (b[i] - b0);
  }
  return sums;
}

// The gradient before the ReLU from that after it, whose output is y.
template <class Scalar>
Scalar Unclipped(Scalar y, Scalar delta) {
  return y > Scalar{0} ? delta : Scalar{0};
}
float Unclipped(Bfloat16 y, Bfloat16 delta) {
  // A number is above 0 where its bits, as a signed integer, are.
  const std::uint16_t kept = static_cast<std::int16_t>(y.value) > 0 ? delta.value : std::uint16_t{0};
  return std::bit_cast<float>(std::uint32_t{kept} << 16);
}

// y = relu(gain .* (z - mean) * inverse_deviation + shift) for one sample. A NaN stays one (nn/keep_nan.h).
template <class Scalar>
void NormalizeAndClip(const LayerNormParameters<Scalar>& parameters, const Scalar* __restrict z, Scalar mean,
                      Scalar inverse_deviation, Eigen::Index units, Scalar* __restrict y) {
  const Scalar* __restrict gain = parameters.gain;
  const Scalar* __restrict shift = parameters.shift;
  for (Eigen::Index i = 0; i < units; ++i) {
    const Scalar value = gain[i] * ((z[i] - mean) * inverse_deviation) + shift[i];
    y[i] = value < Scalar{0} ? Scalar{0} : value;
  }
}

// Sets `d` [units] to one sample's gradient at the normalised sums and, where kAdds, adds to the gradients of
// gain and shift.
template <bool kAdds, class Element, class Sum>
void UnclipAndScale(const Sum* __restrict gain, const Sum* __restrict z, Sum mean, Sum inverse_deviation,
                    const Element* __restrict y, const Element* __restrict delta, Eigen::Index units,
                    Sum* __restrict d, const LayerNormGradient<Sum>& gradient) {
  Sum* __restrict d_gain = gradient.gain;
  Sum* __restrict d_shift = gradient.shift;
  for (Eigen::Index i = 0; i < units; ++i) {
    const Sum unclipped = Unclipped(y[i], delta[i]);
    d[i] = unclipped * gain[i];
    if constexpr (kAdds) {
      d_shift[i] += unclipped;
      d_gain[i] += unclipped * ((z[i] - mean) * inverse_deviation);
    }
  }
}

// Sets `d_z` [units] to the gradient at z from d, that at the normalised sums x: it is
// (d - mean(d) - x mean(d .* x)) / deviation. Where kAdds, adds it to d_bias.
template <bool kAdds, class Sum>
void Denormalize(const Sum* __restrict d, const Sum* __restrict z, Sum mean, Sum inverse_deviation,
                 Eigen::Index units, Sum* __restrict d_z, Sum* __restrict d_bias) {
  const ShiftedSums<Sum> sums = SumShifted(d, Sum{0}, z, mean, units);
  const Sum scale = -inverse_deviation / static_cast<Sum>(units);
  const Sum shift = scale * sums.plain, slope = scale * sums.product * inverse_deviation * inverse_deviation;
  for (Eigen::Index i = 0; i < units; ++i) {
    const Sum value = d[i] * inverse_deviation + ((z[i] - mean) * slope + shift);
    d_z[i] = value;
    if constexpr (kAdds) d_bias[i] += value;
  }
}

}  // namespace

template <class Element>
void LayerNorm<Element>::Resize(Eigen::Index units, Eigen::Index n) {
  if (units == units_ && z_.cols() >= n) return;
  units_ = units;
  z_.resize(PaddedRows<Element>(units), n);
  statistics_.resize(static_cast<std::size_t>(n));
  columns_.resize(2 * units);
}

template <class Element>
Columns<SumOf<Element>> LayerNorm<Element>::Sums(Eigen::Index first, Eigen::Index n) {
  return {z_.data() + first * z_.rows(), z_.rows(), n, z_.rows()};
}

template <class Element>
void LayerNorm<Element>::Forward(const LayerNormParameters<Sum>& parameters, Eigen::Index first,
                                 const Columns<Element>& y) {
  const Sum n = static_cast<Sum>(units_);
  for (Eigen::Index j = 0; j < y.cols; ++j) {
    // Distances from an entry of the sample itself: the square of their mean is at most units times the
    // variance, so that the difference below cancels little, however far from 0 the entries are.
    const Sum* const z = z_.data() + (first + j) * z_.rows();
    const ShiftedSums<Sum> sums = SumShifted(z, z[0], z, z[0], units_);
    const Sum distance = sums.plain / n;
    const Sum variance = sums.product / n - distance * distance;
    const Statistics statistics{z[0] + distance, Sum{1} / std::sqrt(variance + static_cast<Sum>(kEpsilon))};
    statistics_[static_cast<std::size_t>(first + j)] = statistics;
    Element* const out = y.values + j * y.stride;
    const auto normalize = [&](Sum* to) {
      NormalizeAndClip(parameters, z, statistics.mean, statistics.inverse_deviation, units_, to);
    };
    if constexpr (std::is_same_v<Element, Sum>) {
      normalize(out);
    } else {
      normalize(columns_.data());
      RoundToBfloat16(columns_.data(), units_, out);
    }
  }
}

template <class Element>
void LayerNorm<Element>::Backward(const LayerNormParameters<Sum>& parameters, Eigen::Index sample,
                                  const Element* y, Element* delta, const LayerNormGradient<Sum>* gradient) {
  if (gradient != nullptr) {
    BackwardOf<true>(parameters, sample, y, delta, *gradient);
  } else {
    BackwardOf<false>(parameters, sample, y, delta, {});
  }
}

template <class Element>
template <bool kAdds>
void LayerNorm<Element>::BackwardOf(const LayerNormParameters<Sum>& parameters, Eigen::Index sample,
                                    const Element* y, Element* delta,
                                    const LayerNormGradient<Sum>& gradient) {
  const Sum* const z = z_.data() + sample * z_.rows();
  const auto [mean, inverse_deviation] = statistics_[static_cast<std::size_t>(sample)];
  Sum* const d = columns_.data();
  UnclipAndScale<kAdds>(parameters.gain, z, mean, inverse_deviation, y, delta, units_, d, gradient);
  if constexpr (std::is_same_v<Element, Sum>) {
    Denormalize<kAdds>(d, z, mean, inverse_deviation, units_, delta, gradient.bias);
  } else {
    Sum* const d_z = d + units_;
    Denormalize<kAdds>(d, z, mean, inverse_deviation, units_, d_z, gradient.bias);
    RoundToBfloat16(d_z, units_, delta);
  }
}

template class LayerNorm<float>;
template class LayerNorm<double>;
template class LayerNorm<Bfloat16>;

}  // namespace dbr
