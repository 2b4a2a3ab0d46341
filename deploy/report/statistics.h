// Figures over the seeds of a run, as the report prints them.
#pragma once

#include <vector>

#include "absl/types/span.h"
#include "core/rng.h"

namespace dbr {

// NaN for no values.
double Mean(absl::Span<const double> values);

// With n - 1 below the line; NaN for fewer than two values.
double SampleStd(absl::Span<const double> values);

// The mean of what is left when the smallest floor(n / 4) values and as many of the largest are cut off (the
// rule of SciPy's trim_mean at 0.25): for fewer than four values the mean. NaN for none. O(n log n).
double InterquartileMean(std::vector<double> values);

// The value below which the share `q` in [0, 1] of the values lies, linear between neighbours; NaN for none.
double Quantile(std::vector<double> values, double q);

struct Interval {
  double low = 0;
  double high = 0;
};

// The 95% percentile interval of the interquartile mean of all values together, by the stratified bootstrap
// of Agarwal et al. 2021 (Deep Reinforcement Learning at the Edge of the Statistical Precipice): each of
// kResamples resamples draws from every stratum (a task) as many of its values (its runs) as it has, with
// replacement. NaN where a stratum has fewer than two values or there is none.
inline constexpr int kResamples = 2000;
Interval StratifiedBootstrap(absl::Span<const std::vector<double>> strata, Rng& rng);

}  // namespace dbr
