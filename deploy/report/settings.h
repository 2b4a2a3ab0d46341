// What a run's config sets, in few words.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "proto/config.pb.h"

namespace dbr::report {

struct Settings {
  // "path.to.field: value" for each field that is not at its schema's default, one a line, in the schema's
  // order; without the random seed and without what changes nothing (OutcomeConfig).
  std::string differences;
  // CRC-32C of the text of the OutcomeConfig without its random seed, 8 hexadecimal digits: runs with the
  // same one differ in nothing else that could change what they come to.
  std::string digest;
};

Settings SettingsOf(const Config& config);

// The settings of a config file. See LoadConfig for the errors.
absl::StatusOr<Settings> LoadSettings(const std::string& path);

}  // namespace dbr::report
