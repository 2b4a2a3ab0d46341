#include "deploy/report/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

namespace dbr {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace

double Mean(absl::Span<const double> values) {
  if (values.empty()) return kNaN;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double SampleStd(absl::Span<const double> values) {
  if (values.size() < 2) return kNaN;
  const double mean = Mean(values);
  double squares = 0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

double InterquartileMean(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t cut = values.size() / 4;
  return Mean(absl::MakeConstSpan(values).subspan(cut, values.size() - 2 * cut));
}

double Quantile(std::vector<double> values, double q) {
  if (values.empty()) return kNaN;
  std::sort(values.begin(), values.end());
  const double place = q * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

Interval StratifiedBootstrap(absl::Span<const std::vector<double>> strata, Rng& rng) {
  const auto too_few = [](const std::vector<double>& stratum) { return stratum.size() < 2; };
  if (strata.empty() || std::any_of(strata.begin(), strata.end(), too_few)) return {kNaN, kNaN};
  std::vector<double> means, drawn;
  for (int i = 0; i < kResamples; ++i) {
    drawn.clear();
    for (const std::vector<double>& stratum : strata) {
      const auto size = static_cast<std::uint32_t>(stratum.size());
      for (std::uint32_t k = 0; k < size; ++k) drawn.push_back(stratum[rng.Below(size)]);
    }
    means.push_back(InterquartileMean(drawn));
  }
  return {Quantile(means, 0.025), Quantile(std::move(means), 0.975)};
}

}  // namespace dbr
