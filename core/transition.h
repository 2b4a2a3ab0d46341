// One step of experience, and how it lies in a flat row of floats.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

#include "absl/types/span.h"
#include "core/columns.h"
#include "core/space.h"

namespace dbr {

// An advantage that no critic has given yet, and a return that is not there.
inline constexpr float kUnjudged = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kNoReturn = std::numeric_limits<float>::quiet_NaN();

// A transition (s, a, r, discount, s') as views into memory that the caller owns.
// Masks hold 1 for each legal action, 0 for the others, and are empty for a continuous space.
struct TransitionView {
  absl::Span<const float> observation;
  absl::Span<const float> action;  // a discrete action's index, or a continuous one's dimensions in [-1, 1]
  absl::Span<const float> mask;
  float reward = 0;
  float discount = 0;  // 0 after a true terminal, gamma elsewhere (also where an episode is cut)
  absl::Span<const float> next_observation;
  absl::Span<const float> next_mask;
  // What was done at the next state, or zeros after a true terminal. It counts where the layout has it.
  absl::Span<const float> next_action;
  // R: the discounted sum of the rewards of the episode from here on, in the environment's units
  // (core/returns.h). It counts where the layout has a return, and must be finite there.
  float monte_carlo_return = kNoReturn;
};

// The columns that transitions carry only where a run's algorithm reads them.
struct OptionalColumns {
  bool returns = false;       // Monte-Carlo returns
  bool next_actions = false;  // what was done at the next state
};

// Where the values of a transition lie in a row of `stride()` floats, in the order of core/columns.h:
//
//   | observation | action | mask | reward | discount | return | next_observation | next_mask | next_action |
//     observation   action   mask      1         1      0 or 1      observation        mask     0 or action
//
// Replay servers, writers and readers of one run have the same layout, and refuse another.
struct TransitionLayout {
  int observation_width = 0;
  int action_width = 0;       // 1 for a discrete action
  int mask_width = 0;         // number of discrete actions; 0 for a continuous space
  int return_width = 0;       // 1 where transitions carry their Monte-Carlo return, else 0
  int next_action_width = 0;  // action_width where transitions carry their next action, else 0

  // `optional`: as OptionalColumnsOf (proto/config/config_file.h) says of the run's config.
  static TransitionLayout Of(const EnvSpec& spec, const OptionalColumns& optional = {}) {
    const int action = spec.actions.width();
    return {spec.observation_size, action, spec.actions.mask_width(), optional.returns ? 1 : 0,
            optional.next_actions ? action : 0};
  }

  ColumnSet<ColumnPlace> columns() const {
    ColumnSet<ColumnPlace> places;
    int offset = 0;
#define DBR_PLACE(value, column, width, Kind)         \
  places.column = {#column, #value, (width), offset}; \
  offset += (width);
    DBR_TRANSITION_COLUMNS(DBR_PLACE)
#undef DBR_PLACE
    return places;
  }
  // Floats in a row.
  int stride() const {
    int floats = 0;
    ForEachColumn([&floats](const ColumnPlace& place) { floats += place.width; }, columns());
    return floats;
  }

  // For who wants one value of a row: the floats before it.
  int action_offset() const {
    return columns().actions.offset;
  }
  int reward_offset() const {
    return columns().rewards.offset;
  }
  int discount_offset() const {
    return columns().discounts.offset;
  }
  int return_offset() const {
    return columns().returns.offset;
  }
  int next_observation_offset() const {
    return columns().next_observations.offset;
  }
  int next_mask_offset() const {
    return columns().next_masks.offset;
  }
  int next_action_offset() const {
    return columns().next_actions.offset;
  }

  bool operator==(const TransitionLayout&) const = default;
};

// Pointers to the values of `transition`, by column, to be visited beside other columns.
inline ColumnSet<const absl::Span<const float>*, const float*> ValuesOf(const TransitionView& transition) {
#define DBR_POINTER(value, column, width, Kind) .column = &transition.value,
  return {DBR_TRANSITION_COLUMNS(DBR_POINTER)};
#undef DBR_POINTER
}
inline ColumnSet<absl::Span<const float>*, float*> ValuesOf(TransitionView* transition) {
#define DBR_POINTER(value, column, width, Kind) .column = &transition->value,
  return {DBR_TRANSITION_COLUMNS(DBR_POINTER)};
#undef DBR_POINTER
}

// The floats of a value, and back: a value becomes what lies at `floats` (a view, or a copy of the one
// float). `width`: of the value's column; a lone float stays as it was where that is 0.
inline absl::Span<const float> FloatsOf(const absl::Span<const float>& value, int) {
  return value;
}
inline absl::Span<const float> FloatsOf(const float& value, int width) {
  return {&value, static_cast<std::size_t>(width)};
}
inline void SetValue(const float* floats, int width, absl::Span<const float>* value) {
  *value = {floats, static_cast<std::size_t>(width)};
}
inline void SetValue(const float* floats, int width, float* value) {
  if (width > 0) *value = *floats;
}

// Writes `transition` to `row` [layout.stride()]. Its spans have the layout's widths.
inline void WriteRow(const TransitionView& transition, const TransitionLayout& layout, float* row) {
  const auto write = [row](const ColumnPlace& place, const auto* value) {
    const absl::Span<const float> floats = FloatsOf(*value, place.width);
    std::copy(floats.begin(), floats.end(), row + place.offset);
  };
  ForEachColumn(write, layout.columns(), ValuesOf(transition));
}

// The transition that lies in `row` [layout.stride()]; views into it.
inline TransitionView ViewRow(const float* row, const TransitionLayout& layout) {
  TransitionView transition;
  const auto view = [row](const ColumnPlace& place, auto* value) {
    SetValue(row + place.offset, place.width, value);
  };
  ForEachColumn(view, layout.columns(), ValuesOf(&transition));
  return transition;
}

// How an episode went; known with the transition that ended it.
struct EpisodeEnd {
  float episode_return = 0;  // undiscounted sum of rewards
  float score =
      std::numeric_limits<float>::quiet_NaN();  // 1 win, 0.5 draw, 0 loss; NaN: the environment has none
  int length = 0;                               // steps of the agent
};

}  // namespace dbr
