// TensorBoard's event records: TFRecord framing around the Event message of its event.proto.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Tag and value of one scalar.
using Scalars = std::vector<std::pair<std::string, double>>;

// One record: length (8 bytes), masked CRC-32C of the length (4), `payload`, masked CRC-32C of the payload
// (4); little-endian.
std::string FrameRecord(absl::string_view payload);

// The record that opens every event file, and the one for a row of scalars. `wall_time` is in seconds since
// 1970.
std::string VersionRecord(double wall_time);
std::string ScalarRecord(std::int64_t step, double wall_time, const Scalars& scalars);

// "events.out.tfevents.SECONDS.HOST.PID": TensorBoard reads the files of a folder in the order of their
// names, so that a resumed run continues in a file of its own.
std::string EventFileName(double wall_time);

}  // namespace dbr
