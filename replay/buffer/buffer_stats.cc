#include "replay/buffer/buffer_stats.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace dbr {
namespace {

constexpr int kBins = 20;

// The smallest of 1, 2, 5 times a power of ten above `value`.
double RoundUp(double value) {
  if (value <= 0) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
    if (value < factor * power) return factor * power;
  }
  return 20 * power;
}

}  // namespace

LabelSummary SummarizeLabels(const std::vector<float>& advantages, std::vector<std::uint64_t> ages) {
  LabelSummary summary;
  double largest = 0;
  for (const float advantage : advantages)
    largest = std::max(largest, std::abs(static_cast<double>(advantage)));
  const double limit = RoundUp(largest);
  for (int i = 0; i <= kBins; ++i) summary.edges.push_back(limit * (2.0 * i / kBins - 1));
  summary.histogram.assign(kBins, 0);
  for (const float advantage : advantages) {
    const double place = std::floor((advantage / limit + 1) * kBins / 2);
    ++summary.histogram[static_cast<std::size_t>(std::clamp(place, 0.0, kBins - 1.0))];
  }
  if (ages.empty()) return summary;
  summary.age_mean = std::accumulate(ages.begin(), ages.end(), 0.0) / static_cast<double>(ages.size());
  const auto p95 = ages.begin() + static_cast<std::ptrdiff_t>((ages.size() - 1) * 95 / 100);
  std::nth_element(ages.begin(), p95, ages.end());
  summary.age_p95 = static_cast<double>(*p95);
  return summary;
}

}  // namespace dbr
