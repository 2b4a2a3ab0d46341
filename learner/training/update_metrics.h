// The metrics of an update, and the one check that they are finite.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/types/span.h"
#include "core/check.h"
#include "learner/algorithm.h"

namespace dbr {

// Sets `metrics` to `values`, in order. Returns Internal, naming the first value that is not finite. Requires
// as many values as metrics.
inline absl::Status SetMetrics(absl::Span<const double> values, std::uint64_t updates,
                               std::vector<UpdateMetric>* metrics) {
  DBR_CHECK(values.size() == metrics->size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    UpdateMetric& metric = (*metrics)[i];
    metric.value = values[i];
    if (std::isfinite(metric.value)) continue;
    return absl::InternalError(
        absl::StrCat("update ", updates, ": ", metric.name,
                     " is not finite. Resume from the last checkpoint with a smaller learning_rate."));
  }
  return absl::OkStatus();
}

struct AdvantageFigures {
  double mean = 0;
  double positive = 0;  // the share of advantages at or above 0
  double deviation = 0;
};

inline AdvantageFigures FiguresOf(const std::vector<float>& advantages) {
  const Eigen::Map<const Eigen::ArrayXf> values(advantages.data(),
                                                static_cast<Eigen::Index>(advantages.size()));
  AdvantageFigures figures;
  figures.mean = values.mean();
  figures.positive = static_cast<double>((values >= 0).count()) / static_cast<double>(advantages.size());
  figures.deviation = std::sqrt((values - static_cast<float>(figures.mean)).square().mean());
  return figures;
}

}  // namespace dbr
