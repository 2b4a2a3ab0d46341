// TensorBoard's event records: TFRecord framing around the messages of proto/tensorboard_event.proto.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr {

// Scalars that belong to one moment, each with its tag. TensorBoard shows a value with the precision of a
// float.
using Scalars = std::vector<std::pair<std::string, double>>;

// One record: length (8 bytes), masked CRC-32C of the length (4), `payload`, masked CRC-32C of the payload
// (4); little-endian.
std::string FrameRecord(absl::string_view payload);

// The record that opens every event file. `wall_time` is in seconds since 1970.
std::string VersionRecord(double wall_time);
// The record of a row of scalars at `step`, which counts whatever the run counts by (updates, transitions).
std::string ScalarRecord(std::int64_t step, double wall_time, const Scalars& scalars);

// The record of a program that begins at `step`, after another one that may have gone further: TensorBoard
// drops every scalar of earlier records whose step is `step` or greater, whatever it counts by.
std::string SessionStartRecord(std::int64_t step, double wall_time);

// "events.out.tfevents.SECONDS.HOST.PID": TensorBoard reads the files of a folder in the order of their
// names, so that a resumed run continues in a file of its own.
std::string EventFileName(double wall_time);

}  // namespace dbr
