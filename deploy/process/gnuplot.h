// Draws plots by gnuplot.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"

namespace dbr {

// Runs gnuplot on `script`. Writes the script to `folder`/plots.gp and gnuplot's output to plots.log beside
// it, and removes both on success. Blocks until gnuplot has ended, at most for `deadline`. Uses no shell.
// Returns FailedPrecondition where gnuplot is not installed, with how to install it; Internal with its last
// words where it failed; DeadlineExceeded; Cancelled after SIGINT or SIGTERM, which the caller's threads must
// block (core/shutdown.h); and the errors of writing a file.
absl::Status RunGnuplot(absl::string_view script, const std::string& folder, absl::Duration deadline);

}  // namespace dbr
