// Keys by which other programs tell where episodes end.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "replay/dataset/hdf5_file.h"

namespace dbr {

// Checks that `group` ("" is the root) has no array that tells of the ends of episodes by a name other than
// those in `read`, which the caller reads: to pass over it would join episodes. InvalidArgument, naming the
// array. Groups and single values of such a name are something else and are left alone.
absl::Status CheckEndKeys(const Hdf5File& file, const std::string& group,
                          absl::Span<const absl::string_view> read);

}  // namespace dbr
