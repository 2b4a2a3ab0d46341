// Reads, overrides, checks and prints the one configuration schema. Thread-safe: pure functions.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/transition.h"
#include "proto/config.pb.h"

namespace dbr {

// Reads a text-format Config, applies `overrides` and checks the result. An override is
// "path.to.field=value", as --set takes it; for a repeated field, "path=[a, b]" or "path=a". Blocks for
// LoadConfig's reading of the file. Returns InvalidArgument with ALL errors: unknown fields with line, column
// and the nearest known name, values of another type, and fields out of bounds with path, bounds and value.
// LoadConfig also returns ReadTextFile's errors.
absl::StatusOr<Config> LoadConfig(const std::string& path, const std::vector<std::string>& overrides = {});
absl::StatusOr<Config> ParseConfig(absl::string_view text, const std::vector<std::string>& overrides = {});

// `config` with every field set: the schema's default where `config` sets none, "dbr" where it names no
// algorithm, and HiddenSizes(). Two configs mean the same where these are equal. Bounds are not looked at.
Config WithDefaults(const Config& config);

// WithDefaults(config) as text; ParseConfig reads it back as that.
std::string PrintConfig(const Config& config);

// Whether all updates are made on the seed buffer, so that no actor ever acts.
bool TrainsOfflineAlone(const Config& config);

// Which columns the algorithm reads beside those that all need: Monte-Carlo returns (dbr's advantage SIL for
// R - V(s); cal_ql as the floor of Q) and next actions (rebrac with a critic_penalty).
OptionalColumns OptionalColumnsOf(const AlgorithmConfig& config);

// Returns the config's hidden_sizes, or the paper's 256, 256, 256 where it has none.
std::vector<int> HiddenSizes(const Config& config);

}  // namespace dbr
