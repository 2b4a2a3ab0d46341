// Drawing by gnuplot.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"

namespace dbr {

// Runs gnuplot over `script`, which is written to `folder`/plots.gp with gnuplot's own words beside it in
// plots.log; both are removed when all went well. Blocks until it has ended, at most `deadline` long. No
// shell takes part. FailedPrecondition where gnuplot is not installed, saying how to install it; Internal
// with its last words where it failed; DeadlineExceeded; Cancelled after SIGINT or SIGTERM, which the
// caller's threads block (core/shutdown.h); and what writing a file can give.
absl::Status RunGnuplot(absl::string_view script, const std::string& folder, absl::Duration deadline);

}  // namespace dbr
