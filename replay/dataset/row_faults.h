// What is wrong with single rows of a file.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/types/span.h"

namespace dbr {

// What was found among the rows read so far.
struct RowFaults {
  std::int64_t bad = 0;         // rows with a value that is not finite, or with a bad flag
  std::int64_t first_bad = -1;  // number of the first one; -1: none
  std::int64_t bad_flags =
      0;  // of them, rows with a flag that is neither 0 nor 1, or that contradicts another
  std::int64_t actions_outside = 0;  // rows, not bad, with an action outside [-1, 1]
};

// Why a row is bad: the bits of its mark. 0: it is not.
enum RowMark : std::uint8_t { kNotFinite = 1, kBadFlag = 2 };

// Marks row i where row i of `values` [rows x width] has a value that is not finite. Fast where none has.
void MarkNotFinite(absl::Span<const float> values, int width, std::vector<std::uint8_t>* marks);

// Marks row i where flags[i] is neither 0 nor 1, and makes that flag 0.
void MarkBadFlags(absl::Span<std::uint8_t> flags, std::uint8_t* marks);

// How many rows of `actions` [rows x width] that are not marked have a value outside [-1, 1], by more than
// rounding explains. Fast where none has.
std::int64_t CountOutside(absl::Span<const float> actions, int width, const std::uint8_t* marks);

// Adds the rows with these marks to `faults`; marks[0] is row `first` of the file.
void CountMarks(absl::Span<const std::uint8_t> marks, std::int64_t first, RowFaults* faults);

}  // namespace dbr
