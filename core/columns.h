// The columns of transitions: the one list from which rows, batches, messages and checks take theirs.
#pragma once

#include "absl/base/attributes.h"

namespace dbr {

// One line for each column, in the order in which the values of a transition lie in its row:
//
//   COLUMN(the value's field in TransitionView,
//          the column's name, in every ColumnSet and in the message TransitionBatch,
//          floats in a row, by the widths of TransitionLayout,
//          Wide where they may be several, Narrow where there is at most one)
//
// A new column is a line here, a field of TransitionView, a field of TransitionBatch (proto/transition.proto)
// with the column's name, and whatever its producer writes into it. Everything between takes it from here.
#define DBR_TRANSITION_COLUMNS(COLUMN)                                 \
  COLUMN(observation, observations, observation_width, Wide)           \
  COLUMN(action, actions, action_width, Wide)                          \
  COLUMN(mask, masks, mask_width, Wide)                                \
  COLUMN(reward, rewards, 1, Narrow)                                   \
  COLUMN(discount, discounts, 1, Narrow)                               \
  COLUMN(monte_carlo_return, returns, return_width, Narrow)            \
  COLUMN(next_observation, next_observations, observation_width, Wide) \
  COLUMN(next_mask, next_masks, mask_width, Wide)                      \
  COLUMN(next_action, next_actions, next_action_width, Wide)

// One member for each column, named as the column is: its place in a row, a pointer, a vector, a matrix.
// Plain values. Structs that hold columns and something beside them (Batch, InsertColumns) inherit from it.
template <class Wide, class Narrow = Wide>
struct ColumnSet {
#define DBR_MEMBER(value, column, width, Kind) Kind column{};
  DBR_TRANSITION_COLUMNS(DBR_MEMBER)
#undef DBR_MEMBER
};

// Calls visit(holder.column...) for each column in the order of the list, with that column of every holder. A
// holder is a ColumnSet, or has members of the same names. The loop is unrolled where it is compiled: nothing
// is looked up or called through a pointer.
template <class Visit, class... Holders>
ABSL_ATTRIBUTE_ALWAYS_INLINE inline void ForEachColumn(Visit&& visit, Holders&&... holders) {
#define DBR_VISIT(value, column, width, Kind) visit(holders.column...);
  DBR_TRANSITION_COLUMNS(DBR_VISIT)
#undef DBR_VISIT
}

// Where a column lies in a row, and what it is called.
struct ColumnPlace {
  const char* name = "";   // the column's: "observations"
  const char* value = "";  // what one transition has in it: "observation"
  int width = 0;           // floats in a row; 0 where the layout is without the column
  int offset = 0;          // floats of the row before them
};

}  // namespace dbr
