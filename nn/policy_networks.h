// The networks of a policy: which there are, of which sizes, and what they are fed.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/batch.h"
#include "core/policy_snapshot.h"
#include "nn/mlp.h"

namespace dbr {

// The layers of a policy's networks. Over discrete actions every network maps an observation to a value for
// each action. Over continuous ones the policy and the behaviour policies map it to means and log-stds
// [2 * dimensions], and a critic maps [observation; action] to one value.
MlpShape PolicyShape(const PolicySpec& spec);
MlpShape CriticShape(const PolicySpec& spec);

// Immutable; shared by pointer between threads. Holds the snapshot that it was made from.
class PolicyNetworks {
 public:
  // InvalidArgument where a size is not above 0, the network "policy" is missing, or a network has not as
  // many parameters as its sizes ask; the message names the network.
  static absl::StatusOr<std::shared_ptr<const PolicyNetworks>> Create(PolicySnapshot snapshot);

  const PolicySnapshot& snapshot() const { return snapshot_; }
  const PolicySpec& spec() const { return snapshot_.spec; }
  // The layers of a network by its name: those of CriticShape for the critics, else those of PolicyShape.
  const MlpShape& ShapeOf(absl::string_view network) const;
  // Returns the output [output x n] of a network by its name, for x [input x n]. It is valid until the next
  // call with the same workspace. Requires a network of that name.
  const MatrixX<float>& Run(absl::string_view network, const ConstMatrixRef<float>& x,
                            MlpActivations<float>* activations) const;
  bool has_critics() const;        // both twins
  bool has_dual_behavior() const;  // beta+ and beta-
  bool has_behavior() const;       // one beta, fitted to all the data

  // True, with (observation - mean) / deviation [observation x n] in `normalized`, where the policy was
  // trained on that; else false, and `normalized` stays as it is.
  bool Normalize(const ConstMatrixRef<float>& observations, MatrixX<float>* normalized) const;

 private:
  explicit PolicyNetworks(PolicySnapshot snapshot);

  PolicySnapshot snapshot_;
  MlpShape policy_shape_, critic_shape_;
};

}  // namespace dbr
