// How much each transition of a batch counts to D+ and to D-, where a policy is held near their actions.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/batch.h"
#include "proto/config.pb.h"

namespace dbr {

struct ActionWeighting {
  DbrConfig::ActionWeights kind = DbrConfig::ALL;
  double plus_margin = 0;   // MARGIN
  double temperature = 1;   // EXPONENTIAL, in deviations of the advantage
  double max_weight = 20;   // EXPONENTIAL
  double minus_margin = 0;  // of D-

  static ActionWeighting Of(const DbrConfig& config) {
    return {.kind = config.action_weights(),
            .plus_margin = config.plus_margin(),
            .temperature = config.advantage_temperature(),
            .max_weight = config.max_action_weight(),
            .minus_margin = config.minus_margin()};
  }
};

// Sets `plus` [n] and `minus` [n] to the weights of the transitions with the advantages A [n]: plus to 1
// (ALL), to 1 where A >= plus_margin and else 0 (MARGIN), or to min(exp(A / (temperature sd A)), max_weight)
// (EXPONENTIAL); minus to 1 where A <= -minus_margin and else 0. A NaN goes on into both.
template <class Scalar>
void WeighActions(const ActionWeighting& options, const VectorX<Scalar>& advantages, VectorX<Scalar>* plus,
                  VectorX<Scalar>* minus) {
  const Eigen::Index n = advantages.size();
  plus->resize(n);
  minus->resize(n);
  const Scalar mean = advantages.mean();
  const Scalar deviation = std::sqrt((advantages.array() - mean).square().mean());
  const auto margin = static_cast<Scalar>(options.plus_margin),
             below = -static_cast<Scalar>(options.minus_margin);
  const Scalar unit = static_cast<Scalar>(options.temperature) * deviation;
  const auto max_log = static_cast<Scalar>(std::log(options.max_weight));
  for (Eigen::Index j = 0; j < n; ++j) {
    const Scalar advantage = advantages[j];
    const Scalar nan_or_0 = advantage - advantage;
    Scalar weight = 1;
    if (options.kind == DbrConfig::MARGIN) weight = advantage >= margin ? 1 : 0;
    if (options.kind == DbrConfig::EXPONENTIAL && deviation != 0) {
      weight = std::exp(std::min(advantage / unit, max_log));
    }
    (*plus)[j] = weight + nan_or_0;
    (*minus)[j] = (advantage <= below ? 1 : 0) + nan_or_0;
  }
}

}  // namespace dbr
