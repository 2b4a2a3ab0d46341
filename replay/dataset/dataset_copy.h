// Copying offline data from a file of one layout to a file of another.
#pragma once

#include <cstdint>
#include <functional>

#include "absl/status/status.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/dataset_writer.h"

namespace dbr {

// Appends all transitions of `reader` to `writer`, episode by episode, and leaves it to the caller to finish
// the writer. What a gap (a row that was left out) cuts off becomes an episode of its own. Calls `go_on`
// after every few thousand transitions with their number so far; Cancelled soon after it returns false. Other
// errors are the reader's and the writer's. Requires that their sizes agree (CHECKed). Holds one episode in
// memory.
absl::Status CopyDataset(DatasetReader* reader, DatasetWriter* writer,
                         const std::function<bool(std::int64_t)>& go_on);

}  // namespace dbr
