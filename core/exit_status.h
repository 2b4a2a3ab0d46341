// What the exit statuses of our processes mean to the one who started them.
#pragma once

namespace dbr {

// The exit status for what another start cannot mend: wrong flags, a wrong config, or an error that is final
// (ExitStatusOf, proto/rpc/exit_status.h). Whoever supervises the process does not start it again. Every
// other status above 0 is an error that may pass.
inline constexpr int kFinalExit = 2;

}  // namespace dbr
