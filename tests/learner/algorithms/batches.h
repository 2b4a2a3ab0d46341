// Batches and specs for the tests of algorithms.
#pragma once

#include "core/rng.h"
#include "learner/algorithm.h"
#include "proto/config/config_file.h"

namespace dbr {

// A small problem: 5 inputs, 3 actions (or 2 dimensions of action), two hidden layers of 8.
inline AlgorithmSpec SmallSpec(std::uint64_t seed = 1, ActionKind actions = ActionKind::kDiscrete) {
  AlgorithmSpec spec;
  spec.env = "test";
  spec.observation_size = 5;
  spec.actions = {actions, actions == ActionKind::kDiscrete ? 3 : 2};
  spec.hidden_sizes = {8, 8};
  spec.config.set_batch_size(16);
  spec.config.mutable_dbr();
  spec.seed = seed;
  return spec;
}

// A symmetry of the small problem, for either kind of action. Action 2 is its own image.
inline Symmetry SmallSymmetry(ActionKind actions = ActionKind::kDiscrete) {
  return {.observation = {1, 0, 2, 4, 3},
          .action = actions == ActionKind::kDiscrete ? std::vector<int>{1, 0, 2} : std::vector<int>{1, 0}};
}

// Random transitions, with returns and next actions where the algorithm needs them. In a discrete space
// action 2 is illegal in every third state.
template <class Scalar>
BasicBatch<Scalar> RandomBatch(const AlgorithmSpec& spec, int n, Rng& rng) {
  BasicBatch<Scalar> batch;
  batch.Resize(TransitionLayout::Of(
                   {.name = spec.env, .observation_size = spec.observation_size, .actions = spec.actions},
                   OptionalColumnsOf(spec.config)),
               n, /*with_keys=*/true);
  const auto draw = [&](Scalar) { return static_cast<Scalar>(2 * rng.Uniform() - 1); };
  batch.observations = batch.observations.unaryExpr(draw).eval();
  batch.next_observations = batch.next_observations.unaryExpr(draw).eval();
  batch.actions = batch.actions.unaryExpr(draw).eval();
  batch.masks.setOnes();
  batch.next_masks.setOnes();
  for (int j = 0; j < n; ++j) {
    batch.rewards[j] = static_cast<Scalar>(rng.Uniform());
    batch.discounts[j] = j % 5 == 0 ? Scalar{0} : Scalar{0.99};
    batch.keys[static_cast<std::size_t>(j)] = static_cast<std::uint64_t>(j);
    if (!spec.actions.discrete()) continue;
    const bool restricted = j % 3 == 0;
    if (restricted) batch.masks(2, j) = batch.next_masks(2, j) = 0;
    batch.actions(0, j) = static_cast<Scalar>(rng.Below(restricted ? 2 : 3));
  }
  // The optional columns are drawn last, so that the rest is the same with and without them.
  for (Scalar& value : batch.returns) value = static_cast<Scalar>(3 * rng.Uniform() - 1);
  batch.next_actions = batch.next_actions.unaryExpr(draw).eval();
  return batch;
}

}  // namespace dbr
