// From one layout to another.
#pragma once

#include <cstdint>
#include <functional>

#include "absl/status/status.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/dataset_writer.h"

namespace dbr {

// Appends all transitions of `reader` to `writer`, in episodes, and does not finish it. What a gap (a row
// that was left out) cuts off becomes an episode of its own. After every few thousand transitions `go_on`
// hears how many there were so far; Cancelled soon after it answers false. Other errors: those of reader and
// writer. Sizes must fit (CHECKed). Holds one episode in memory.
absl::Status CopyDataset(DatasetReader* reader, DatasetWriter* writer,
                         const std::function<bool(std::int64_t)>& go_on);

}  // namespace dbr
