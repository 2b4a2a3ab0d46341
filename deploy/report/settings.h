// What a run's config sets, in few words.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "proto/config.pb.h"

namespace dbr::report {

struct Settings {
  // "path.to.field: value" for each field that is not at its schema's default, one a line, in the schema's
  // order; without the seed, and of the offline data the file's name alone, for where it lies changes
  // nothing.
  std::string differences;
  // CRC-32C of the effective config's text so taken, 8 hexadecimal digits: cells that differ in
  // nothing but their seeds have the same.
  std::string digest;
};

Settings SettingsOf(const Config& config);

// Of a config file. See LoadConfig for the errors.
absl::StatusOr<Settings> LoadSettings(const std::string& path);

}  // namespace dbr::report
