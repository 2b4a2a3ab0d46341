// The error of a policy whose networks give values that are not finite.
#pragma once

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/policy_snapshot.h"

namespace dbr {

inline absl::Status NotFiniteError(const PolicySnapshot& snapshot) {
  return absl::InternalError(absl::StrCat("policy version ", snapshot.version,
                                          " gives values that are not finite. Use an earlier checkpoint."));
}

}  // namespace dbr
