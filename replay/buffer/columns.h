// Transitions in columns, as views into memory that the caller owns: how batches enter and leave the buffer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/columns.h"
#include "core/transition.h"

namespace dbr {

// `count` transitions to store. Each column (core/columns.h) is [count x width], row after row, its width as
// the layout of the store says; a column of width 0 may be null.
struct InsertColumns : ColumnSet<const float*> {
  int count = 0;
  const float* advantages = nullptr;               // [count], NaN: not yet judged; or null: none is judged
  const std::uint64_t* critic_versions = nullptr;  // [count], of the advantages; or null: all 0

  // Transition i; views into the columns.
  TransitionView Row(const TransitionLayout& layout, int i) const {
    TransitionView transition;
    const auto view = [i](const ColumnPlace& place, const float* column, auto* value) {
      SetValue(column + static_cast<std::size_t>(i) * static_cast<std::size_t>(place.width), place.width,
               value);
    };
    ForEachColumn(view, layout.columns(), *this, ValuesOf(&transition));
    return transition;
  }
  float Advantage(int i) const { return advantages == nullptr ? kUnjudged : advantages[i]; }
  std::uint64_t CriticVersion(int i) const { return critic_versions == nullptr ? 0 : critic_versions[i]; }
};

// Room for one part of a draw: columns of the same shapes, [asked count x width], to be written into.
struct DrawColumns : ColumnSet<float*> {
  std::uint64_t* keys = nullptr;  // [asked count]
};

}  // namespace dbr
