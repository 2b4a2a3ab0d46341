// How far a long command is.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

#include "absl/time/time.h"

namespace dbr {

// What a progress bar shows.
struct BarState {
  std::string label;
  std::string unit;  // what is counted: "steps"
  std::int64_t done = 0;
  std::int64_t total = 0;
  absl::Duration elapsed;
};

// "hopper random  ████▌      45%  450k of 1.0M steps · 18k steps/s · 0:30 left", at most `width` cells.
std::string BarText(const BarState& state, int width);

// Keeps the bar in place on a terminal; where the output is none, writes it as a line now and then. One
// thread. The stream must outlive it.
class ProgressBar {
 public:
  // `every`: how often at most a line is written where `out` is no terminal.
  ProgressBar(std::FILE* out, BarState state, absl::Time now, absl::Duration every);
  ~ProgressBar();  // clears a terminal's line
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void Update(std::int64_t done, absl::Time now);

 private:
  std::FILE* const out_;
  const bool terminal_;
  const absl::Duration every_;
  const absl::Time start_;
  absl::Time last_;  // when it was written
  BarState state_;
};

}  // namespace dbr
