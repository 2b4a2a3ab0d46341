// The one live line of a launch.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "deploy/launch/monitor.h"
#include "deploy/terminal/output.h"
#include "envs/presentation.h"

namespace dbr {

// What the line shows.
struct Progress {
  RunSample sample;
  std::optional<absl::Duration> left;  // empty: no limit, or not known yet
  EnvPresentation presentation;        // how the environment is shown
  std::uint64_t offline_updates = 0;   // while the phase lasts: how many it has
};

// One line of at most `width` cells: episodes, transitions/s, updates/s, sizes of D, D+ and D-, policy
// version and lag (how many versions the slowest subscriber is behind), the newest scores against the watched
// opponents, time left. Without opponents to watch it shows the mean return of the actors' last episodes and
// of the newest evaluation; in the offline phase how far it is, in place of what actors do. Words where there
// is room, abbreviations where there is not.
std::string ProgressText(const Progress& progress, int width);

// Keeps the line in place on a terminal; where the output is none, writes it now and then. One thread. The
// output must outlive it.
class ProgressLine {
 public:
  // `every`: how often at most a line is written where `out` is no terminal.
  ProgressLine(Output* out, absl::Duration every);
  ~ProgressLine();  // ends the line

  void Update(const Progress& progress, absl::Time now);
  // A line of its own above the live one.
  void Say(const std::string& text);
  // Leaves the live line on the screen and starts below it.
  void End();

 private:
  Output* const out_;
  const bool terminal_;
  const absl::Duration every_;
  absl::Time last_ = absl::InfinitePast();
  std::string live_;  // what stands on the terminal's last line
};

}  // namespace dbr
