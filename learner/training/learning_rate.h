// The learning rate over the course of training.
#pragma once

#include <cstdint>

#include "proto/config.pb.h"

namespace dbr {

// Returns the learning rate of update number `updates` (from 0). It falls linearly from learning_rate to
// final_learning_rate over learning_rate_decay_updates updates and then stays there. With 0 decay updates it
// is constant.
inline double LearningRate(const AlgorithmConfig& config, std::uint64_t updates) {
  const std::uint64_t span = config.learning_rate_decay_updates();
  if (span == 0) return config.learning_rate();
  if (updates >= span) return config.final_learning_rate();
  const double done = static_cast<double>(updates) / static_cast<double>(span);
  return config.learning_rate() + done * (config.final_learning_rate() - config.learning_rate());
}

}  // namespace dbr
