// Options and arguments that several subcommands share, each said once.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "deploy/launch/played_policy.h"
#include "nn/policy.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace dbr {

// The layouts of offline data and the robots that record it, as type names of options.
inline constexpr char kLayoutNames[] = "d4rl|d4rl_pybullet|minari";
inline constexpr char kWrittenLayoutNames[] = "d4rl|d4rl_pybullet";
inline constexpr char kRobotNames[] = "hopper|walker2d|half_cheetah|ant";

// Each adds one option to `command`, which writes what the user gives to the last argument while it parses;
// that argument must outlive `command`. The value that it has already is the default.

// --policy FILE_OR_RUN, required.
CLI::Option* AddPolicyOption(CLI::App* command, std::string* policy);
// --which raw|average|best; `which` must be empty, which stands for what the run's config says.
CLI::Option* AddWhichOption(CLI::App* command, std::string* which);
// --mode; `text` says what it decides.
CLI::Option* AddModeOption(CLI::App* command, const std::string& text, std::string* mode);
// --seed N.
CLI::Option* AddSeedOption(CLI::App* command, const std::string& text, std::uint64_t* seed);

// The policy that --policy names: a file, a shipped file (FindShippedFile) or the newest one of a run folder.
// Its "policy" is the raw one. NotFound, DataLoss or InvalidArgument, naming the file.
absl::StatusOr<std::shared_ptr<const PolicyNetworks>> OpenNamedPolicy(const std::string& name);

// The policy that --policy and --which name together. The errors of OpenPlayedPolicy, and InvalidArgument for
// any other `which` than raw, average, best (in any case) and the empty one.
absl::StatusOr<PlayedPolicy> OpenNamedPolicy(const std::string& name, const std::string& which);

// The mode that --mode names: sample, mode, greedy_q or support, in any case. InvalidArgument for any other.
absl::StatusOr<ActingMode> ParseActingMode(const std::string& name);

}  // namespace dbr
