// The sizes of what an agent sees and may do, which every part of the system agrees on. Plain values.
#pragma once

#include <cstdint>
#include <string>

#include "core/symmetry.h"

namespace dbr {

enum class ActionKind { kDiscrete, kContinuous };

// A set of actions: `size` choices (discrete) or a box [-1, 1]^size (continuous).
struct ActionSpace {
  ActionKind kind = ActionKind::kDiscrete;
  int size = 0;

  bool discrete() const { return kind == ActionKind::kDiscrete; }
  // Floats that one action takes in a transition: its index, or one for each dimension.
  int width() const { return discrete() ? 1 : size; }
  // Floats of a legal-action mask: one for each choice, none for a box.
  int mask_width() const { return discrete() ? size : 0; }

  bool operator==(const ActionSpace&) const = default;
};

// The static facts of an environment.
struct EnvSpec {
  std::string name;
  int observation_size = 0;  // floats
  ActionSpace actions;
  int max_episode_steps = 0;  // a longer episode is cut (truncation, not a terminal)
  bool has_score = false;     // episodes end with a score: 1 win, 0.5 draw, 0 loss
  Symmetry symmetry = {};     // empty where there is none, or none is known

  bool operator==(const EnvSpec&) const = default;
};

}  // namespace dbr
