// Runs environments of one kind side by side, so that one forward pass serves them all.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/batch.h"
#include "envs/env.h"
#include "envs/registry/registry.h"

namespace dbr {

// Owns the environments. Column i of every matrix belongs to environment i. A step writes its results beside
// the current observations, so that both sides of a transition can be read before Advance() makes the next
// observations current. Allocates only in its constructor. One thread at a time.
class VectorEnv {
 public:
  // Makes `count` environments. Returns the errors of MakeEnv.
  static absl::StatusOr<std::unique_ptr<VectorEnv>> Create(const EnvOptions& options, int count);

  // Takes at least one environment. All must have the same spec (CHECKed).
  explicit VectorEnv(std::vector<std::unique_ptr<Env>> envs);

  const EnvSpec& spec() const { return envs_.front()->spec(); }
  int size() const { return static_cast<int>(envs_.size()); }

  // Starts an episode in environment i: overwrites column i of observations() and masks().
  void Reset(int i, std::uint64_t seed);

  // Steps environment i by column i of `actions` [action width x size]. Writes column i of the next_
  // matrices. The result stays in results() until the next step.
  const StepResult& Step(int i, const MatrixX<float>& actions);

  // Makes the next observations and masks the current ones. O(1): two swaps. A column that was not stepped
  // since the last call holds an older observation of its environment afterwards.
  void Advance();

  const MatrixX<float>& observations() const { return observations_; }            // [observation x size]
  const MatrixX<float>& masks() const { return masks_; }                          // [mask width x size]
  const MatrixX<float>& next_observations() const { return next_observations_; }  // [observation x size]
  const MatrixX<float>& next_masks() const { return next_masks_; }                // [mask width x size]
  const std::vector<StepResult>& results() const { return results_; }             // [size]

 private:
  std::vector<std::unique_ptr<Env>> envs_;
  MatrixX<float> observations_;
  MatrixX<float> masks_;
  MatrixX<float> next_observations_;
  MatrixX<float> next_masks_;
  std::vector<StepResult> results_;
};

// Column i of a matrix as a span, without a copy.
inline absl::Span<const float> Column(const MatrixX<float>& matrix, int i) {
  return {matrix.data() + matrix.rows() * i, static_cast<std::size_t>(matrix.rows())};
}
inline absl::Span<float> MutableColumn(MatrixX<float>& matrix, int i) {
  return {matrix.data() + matrix.rows() * i, static_cast<std::size_t>(matrix.rows())};
}

}  // namespace dbr
