// A network's parameters as its products read them.
#pragma once

#include "core/batch.h"
#include "nn/rounded_weights.h"

namespace dbr {

// What products read of a network: its flat parameter vector and, where they are made in bfloat16, the
// rounded copy of its weights. Owns nothing.
template <class Scalar>
struct MlpParameters {
  MlpParameters(const Scalar* parameters, const RoundedWeights* rounded_weights = nullptr)
      : values(parameters), rounded(rounded_weights) {}
  MlpParameters(const VectorX<Scalar>& parameters) : MlpParameters(parameters.data()) {}

  const Scalar* values;           // [parameter_count]
  const RoundedWeights* rounded;  // null: products in Scalar's own precision
};

}  // namespace dbr
