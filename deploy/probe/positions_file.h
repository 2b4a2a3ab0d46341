// Connect-4 positions with their exact values, as tests/reference/connect4 has them.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace dbr {

// Columns count from 1 here, as in the file.
struct ReferencePosition {
  std::string id;
  std::string moves;  // from the empty board
  std::vector<int> legal;
  std::vector<int> keeps_value;  // the moves that do not change the outcome under perfect play
  std::vector<int> best;         // the fastest wins or slowest losses
  std::string kind;              // must_block, must_win or empty
  int answer = 0;                // the one right column of a position with a kind

  // Where a move can be wrong.
  bool decisive() const { return keeps_value.size() < legal.size(); }
};

// NotFound, or InvalidArgument naming the file, the entry and the field, with what was expected.
absl::StatusOr<std::vector<ReferencePosition>> LoadPositions(const std::string& path);

}  // namespace dbr
