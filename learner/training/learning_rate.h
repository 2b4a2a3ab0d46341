// The learning rate over the course of training.
#pragma once

#include <cstdint>

#include "proto/config.pb.h"

namespace dbr {

// The rate of update number `updates` (from 0): learning_rate, falling linearly to final_learning_rate over
// learning_rate_decay_updates where that is set.
inline double LearningRate(const AlgorithmConfig& config, std::uint64_t updates) {
  const std::uint64_t span = config.learning_rate_decay_updates();
  if (span == 0) return config.learning_rate();
  if (updates >= span) return config.final_learning_rate();
  const double done = static_cast<double>(updates) / static_cast<double>(span);
  return config.learning_rate() + done * (config.final_learning_rate() - config.learning_rate());
}

}  // namespace dbr
