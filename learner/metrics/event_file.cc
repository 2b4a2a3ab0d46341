#include "learner/metrics/event_file.h"

#include <unistd.h>

#include <cstring>

#include "absl/strings/str_format.h"
#include "core/crc32c.h"

namespace dbr {
namespace {

// Field numbers of tensorboard's Event, Summary and Summary.Value messages.
constexpr int kEventWallTime = 1;
constexpr int kEventStep = 2;
constexpr int kEventFileVersion = 3;
constexpr int kEventSummary = 5;
constexpr int kSummaryValue = 1;
constexpr int kValueTag = 1;
constexpr int kValueSimple = 2;

// Wire types of Protobuf.
constexpr int kVarint = 0;
constexpr int kFixed64 = 1;
constexpr int kBytes = 2;
constexpr int kFixed32 = 5;

template <class T>
void AppendFixed(T value, std::string* out) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out->append(bytes, sizeof value);
}

void AppendVarint(std::uint64_t value, std::string* out) {
  for (; value >= 0x80; value >>= 7) out->push_back(static_cast<char>(value | 0x80));
  out->push_back(static_cast<char>(value));
}

void AppendKey(int field, int wire_type, std::string* out) {
  AppendVarint(static_cast<std::uint64_t>(field << 3 | wire_type), out);
}

void AppendBytes(int field, absl::string_view bytes, std::string* out) {
  AppendKey(field, kBytes, out);
  AppendVarint(bytes.size(), out);
  out->append(bytes.data(), bytes.size());
}

// A checksum stored beside data that may itself hold checksums is rotated and offset, as the TFRecord format
// asks.
std::uint32_t MaskedCrc(const void* data, std::size_t size) {
  const std::uint32_t crc = Crc32c(data, size);
  return ((crc >> 15) | (crc << 17)) + 0xa282ead8u;
}

std::string EventAt(double wall_time) {
  std::string event;
  AppendKey(kEventWallTime, kFixed64, &event);
  AppendFixed(wall_time, &event);
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
  std::string event = EventAt(wall_time);
  AppendBytes(kEventFileVersion, "brain.Event:2", &event);
  return FrameRecord(event);
}

std::string ScalarRecord(std::int64_t step, double wall_time, const Scalars& scalars) {
  std::string summary;
  for (const auto& [tag, value] : scalars) {
    std::string entry;
    AppendBytes(kValueTag, tag, &entry);
    AppendKey(kValueSimple, kFixed32, &entry);
    AppendFixed(static_cast<float>(value), &entry);
    AppendBytes(kSummaryValue, entry, &summary);
  }
  std::string event = EventAt(wall_time);
  AppendKey(kEventStep, kVarint, &event);
  AppendVarint(static_cast<std::uint64_t>(step), &event);
  AppendBytes(kEventSummary, summary, &event);
  return FrameRecord(event);
}

std::string EventFileName(double wall_time) {
  char host[256] = "host";
  gethostname(host, sizeof host - 1);
  return absl::StrFormat("events.out.tfevents.%010d.%s.%d", static_cast<std::int64_t>(wall_time), host,
                         getpid());
}

}  // namespace dbr
