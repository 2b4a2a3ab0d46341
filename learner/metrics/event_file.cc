#include "learner/metrics/event_file.h"

#include <unistd.h>

#include <cstring>

#include "absl/strings/str_format.h"
#include "core/crc32c.h"
#include "proto/tensorboard_event.pb.h"

namespace dbr {
namespace {

template <class T>
void AppendFixed(T value, std::string* out) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out->append(bytes, sizeof value);
}

// A checksum stored beside data that may itself hold checksums is rotated and offset, as the TFRecord format
// asks.
std::uint32_t MaskedCrc(const void* data, std::size_t size) {
  const std::uint32_t crc = Crc32c(data, size);
  return ((crc >> 15) | (crc << 17)) + 0xa282ead8u;
}

tensorboard::Event EventAt(double wall_time) {
  tensorboard::Event event;
  event.set_wall_time(wall_time);
  return event;
}

}  // namespace

std::string FrameRecord(absl::string_view payload) {
  std::string record;
  AppendFixed(static_cast<std::uint64_t>(payload.size()), &record);
  AppendFixed(MaskedCrc(record.data(), record.size()), &record);
  record.append(payload.data(), payload.size());
  AppendFixed(MaskedCrc(payload.data(), payload.size()), &record);
  return record;
}

std::string VersionRecord(double wall_time) {
  tensorboard::Event event = EventAt(wall_time);
  event.set_file_version("brain.Event:2");
  return FrameRecord(event.SerializeAsString());
}

std::string ScalarRecord(std::int64_t step, double wall_time, const Scalars& scalars) {
  tensorboard::Event event = EventAt(wall_time);
  event.set_step(step);
  tensorboard::Summary* summary = event.mutable_summary();
  for (const auto& [tag, value] : scalars) {
    tensorboard::Summary::Value* entry = summary->add_value();
    entry->set_tag(tag);
    entry->set_simple_value(static_cast<float>(value));
  }
  return FrameRecord(event.SerializeAsString());
}

std::string SessionStartRecord(std::int64_t step, double wall_time) {
  tensorboard::Event event = EventAt(wall_time);
  event.set_step(step);
  event.mutable_session_log()->set_status(tensorboard::SessionLog::START);
  return FrameRecord(event.SerializeAsString());
}

std::string EventFileName(double wall_time) {
  char host[256] = "host";
  gethostname(host, sizeof host - 1);
  return absl::StrFormat("events.out.tfevents.%010d.%s.%d", static_cast<std::int64_t>(wall_time), host,
                         getpid());
}

}  // namespace dbr
