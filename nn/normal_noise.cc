#include "nn/normal_noise.h"

#include <algorithm>
#include <numbers>

namespace dbr {
namespace {

// How many pairs are made at a time. Their uniform numbers stay in the first-level cache.
constexpr Eigen::Index kPairs = 256;

}  // namespace

template <class Scalar>
void FillNormal(Rng& rng, Eigen::Index rows, Eigen::Index cols, MatrixX<Scalar>* noise) {
  using Array = Eigen::Array<Scalar, Eigen::Dynamic, 1, 0, kPairs, 1>;
  constexpr Scalar kUnit = Scalar(0x1p-32);
  noise->resize(rows, cols);
  Array radius(kPairs), angle(kPairs);
  for (Eigen::Index first = 0; first < noise->size(); first += 2 * kPairs) {
    const Eigen::Index left = noise->size() - first;
    const Eigen::Index pairs = std::min(kPairs, (left + 1) / 2);
    for (Eigen::Index i = 0; i < pairs; ++i) {
      const std::uint64_t bits = rng();
      radius[i] = static_cast<Scalar>((bits >> 32) + 1) * kUnit;  // in (0, 1]
      angle[i] = static_cast<Scalar>(bits & 0xffffffff) * (kUnit * 2 * std::numbers::pi_v<Scalar>);
    }
    auto r = radius.head(pairs);
    const auto a = angle.head(pairs);
    r = (Scalar{-2} * r.log()).sqrt();
    Eigen::Map<Eigen::Array<Scalar, Eigen::Dynamic, 1>> out(noise->data() + first, std::min(left, 2 * pairs));
    out.head(pairs) = r * a.cos();
    const Eigen::Index second = out.size() - pairs;
    out.tail(second) = r.head(second) * a.head(second).sin();
  }
}

template void FillNormal<float>(Rng&, Eigen::Index, Eigen::Index, MatrixX<float>*);
template void FillNormal<double>(Rng&, Eigen::Index, Eigen::Index, MatrixX<double>*);

}  // namespace dbr
