// The exit status of a process by the error that ended it.
#pragma once

#include "absl/status/status.h"
#include "core/exit_status.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {

// 0 where `status` is OK. kFinalExit where another start would end in the same way: a final error (IsFinal),
// or DataLoss, which here comes from a damaged file of the run and not from the wire, where it may pass. Else
// 1.
inline int ExitStatusOf(const absl::Status& status) {
  if (status.ok()) return 0;
  return IsFinal(status) || absl::IsDataLoss(status) ? kFinalExit : 1;
}

}  // namespace dbr
