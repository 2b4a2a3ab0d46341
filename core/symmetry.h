// A symmetry of an environment: another view of a state in which the same things happen.
#pragma once

#include <vector>

#include "absl/status/status.h"

namespace dbr {

// Where the floats of a state and the actions go. Both vectors are permutations that undo themselves, so that
// the image of an image is the thing itself. A state and its image have the same rewards, and an action in
// the one does what its image does in the other. A plain value; empty for an environment without a symmetry.
struct Symmetry {
  // [observation_size] The float i of an observation is the float observation[i] of its image.
  std::vector<int> observation;
  // [actions.size] The image of the discrete action a, and of its float in a mask, is action[a]. Of a
  // continuous action these are the dimensions.
  std::vector<int> action;

  bool empty() const { return observation.empty() && action.empty(); }

  bool operator==(const Symmetry&) const = default;
};

// Returns InvalidArgument where one of the two vectors has another size or is no permutation that undoes
// itself, and names it.
absl::Status CheckSymmetry(const Symmetry& symmetry, int observation_size, int actions);

}  // namespace dbr
