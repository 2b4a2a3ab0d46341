// Bringing a file's actions into the range of our environments.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

namespace dbr {

// Maps a box [low, high] of actions to [-1, 1], dimension by dimension. A copyable value.
class ActionScale {
 public:
  // Leaves actions as they are.
  ActionScale() = default;

  // Reads a space as Minari writes it: {"type": "Box", "low": [...], "high": [...]}, with `width` numbers
  // each. `path` is named in errors. InvalidArgument for another kind of space, another width, and bounds
  // that are infinite or in the wrong order: then nothing says where -1 and 1 are.
  static absl::StatusOr<ActionScale> FromSpace(const std::string& json, int width, const std::string& path);

  bool identity() const { return middle_.empty(); }

  // Maps `actions` [rows x width] in place.
  void Apply(absl::Span<float> actions) const;

 private:
  std::vector<float> middle_, half_;  // [width] each, of the box; empty: it is [-1, 1] already
};

}  // namespace dbr
