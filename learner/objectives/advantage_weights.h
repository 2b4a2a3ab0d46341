// The weights of advantage-weighted regression.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/batch.h"

namespace dbr {

struct AdvantageWeighting {
  double temperature = 1;   // lambda, above 0
  double max_weight = 100;  // above 0
};

// Sets `weights` [n] to min(exp(A / lambda), max_weight) (Nair et al. 2020, the weights of the policy's step)
// for the advantages A [n]. A weight is never infinite. A NaN stays a NaN.
template <class Scalar>
void AdvantageWeights(const VectorX<Scalar>& advantages, const AdvantageWeighting& options,
                      VectorX<Scalar>* weights) {
  const auto temperature = static_cast<Scalar>(options.temperature);
  const auto max_log = static_cast<Scalar>(std::log(options.max_weight));
  weights->resize(advantages.size());
  for (Eigen::Index j = 0; j < advantages.size(); ++j)
    (*weights)[j] = std::exp(std::min(advantages[j] / temperature, max_log));
}

}  // namespace dbr
