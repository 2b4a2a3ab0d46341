// The facts of a file of offline data, counted while it is read.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace dbr {

struct DatasetFacts {
  std::int64_t rows = 0;         // rows of the file (minari: steps); known from the start
  std::int64_t transitions = 0;  // handed out
  // Episodes that ended: terminals + timeouts. One that the file's end cuts is not among them.
  std::int64_t episodes = 0;
  std::int64_t terminals = 0;  // ends of the task
  std::int64_t timeouts = 0;   // cuts at the time limit
  // Rows with a NaN or an infinite value, or with a flag that is neither 0 nor 1.
  std::int64_t bad_rows = 0;
  std::int64_t bad_flags = 0;        // of them, those with such a flag
  std::int64_t actions_outside = 0;  // rows, not bad, with an action outside [-1, 1]
  // Statistics of the undiscounted returns of the episodes that ended and have no such row; NaN where there
  // are none.
  double return_mean = std::numeric_limits<double>::quiet_NaN();
  double return_std = std::numeric_limits<double>::quiet_NaN();  // of the population
  double return_min = std::numeric_limits<double>::quiet_NaN();
  double return_max = std::numeric_limits<double>::quiet_NaN();
  std::vector<float> returns;  // these returns, by episode
};

// What the warnings are made of.
struct WarningCounts {
  std::uint64_t transitions = 0;
  std::uint64_t episodes = 0;         // that ended
  std::uint64_t actions_outside = 0;  // rows
};

// What a user should know before the data is trained on, one sentence or two each: that no episode ends, that
// actions lie outside the range. For counts of all that was read.
std::vector<std::string> DataWarnings(const WarningCounts& counts);

// The same of a file. Call it when all is read.
std::vector<std::string> WarningsOf(const DatasetFacts& facts);

}  // namespace dbr
