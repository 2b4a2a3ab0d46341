#include "core/policy_snapshot.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/crc32c.h"

namespace dbr {
namespace {

std::string Describe(const ActionSpace& actions) {
  return absl::StrCat(actions.size, actions.discrete() ? " choices" : " dimensions");
}

}  // namespace

std::uint32_t Checksum(const PolicySnapshot& snapshot) {
  std::uint32_t crc = 0;
  for (const auto& [name, parameters] : snapshot.networks) {
    crc = ExtendCrc32c(crc, parameters.data(), parameters.size() * sizeof(float));
  }
  return crc;
}

absl::Status CheckSameSpec(const PolicySpec& expected, const PolicySpec& found) {
  std::vector<std::string> differences;
  const auto differ = [&](absl::string_view field, const std::string& want, const std::string& have) {
    if (want != have) differences.push_back(absl::StrCat(field, ": expected ", want, ", found ", have));
  };
  differ("env", expected.env, found.env);
  differ("observation_size", absl::StrCat(expected.observation_size), absl::StrCat(found.observation_size));
  differ("actions", Describe(expected.actions), Describe(found.actions));
  differ("hidden_sizes", absl::StrJoin(expected.hidden_sizes, "-"), absl::StrJoin(found.hidden_sizes, "-"));
  const auto yes_or_no = [](bool value) { return std::string(value ? "true" : "false"); };
  differ("critic_layer_norm", yes_or_no(expected.critic_layer_norm), yes_or_no(found.critic_layer_norm));
  if (!expected.algorithm.empty()) differ("algorithm", expected.algorithm, found.algorithm);
  if (differences.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the policy is for something else: ", absl::StrJoin(differences, "; "),
                   ". Use a policy that was trained with this config, or the config it was trained with."));
}

}  // namespace dbr
