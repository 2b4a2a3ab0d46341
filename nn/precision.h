// The precision that a config asks for, on this processor.
#pragma once

#include "absl/status/statusor.h"
#include "proto/config.pb.h"

namespace dbr {

// Whether products are to be made in bfloat16. InvalidArgument, with what the processor has, where the config
// asks for BFLOAT16 by name and the processor, or DNNL_MAX_CPU_ISA, does not offer it.
absl::StatusOr<bool> UsesBfloat16(const NetworkConfig& config);

}  // namespace dbr
