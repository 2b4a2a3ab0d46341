// A policy as a safetensors file: the spec, the version and the order of the networks stand in the metadata.
#include "core/policy_file.h"

#include <map>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/safetensors.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr char kDiscrete[] = "discrete";
constexpr char kContinuous[] = "continuous";
constexpr char kTrue[] = "true";
constexpr char kFalse[] = "false";

// Reads typed metadata; keeps the first error, so that a list of fields reads as a list.
class MetadataReader {
 public:
  MetadataReader(const std::map<std::string, std::string>& metadata, const std::string& path)
      : metadata_(metadata), path_(path) {}

  std::string Text(const std::string& key) {
    const auto found = metadata_.find(key);
    if (found != metadata_.end()) return found->second;
    Fail(absl::InvalidArgumentError(absl::StrCat(path_, " is not a policy file: expected metadata '", key,
                                                 "', found none. Use a file of a run's policy folder.")));
    return "";
  }
  template <class Integer>
  Integer Count(const std::string& key) {
    const std::string text = Text(key);
    Integer value = 0;
    if (!absl::SimpleAtoi(text, &value) || value < 0) FailAsDamaged(key, "a whole number", text);
    return value;
  }
  float Real(const std::string& key) {
    const std::string text = Text(key);
    float value = 0;
    if (!absl::SimpleAtof(text, &value)) FailAsDamaged(key, "a number", text);
    return value;
  }
  ActionKind Kind(const std::string& key) {
    const std::string text = Text(key);
    if (text != kDiscrete && text != kContinuous) FailAsDamaged(key, "discrete or continuous", text);
    return text == kContinuous ? ActionKind::kContinuous : ActionKind::kDiscrete;
  }
  // False where the key is missing: older files do not have it.
  bool Flag(const std::string& key) {
    if (metadata_.find(key) == metadata_.end()) return false;
    const std::string text = Text(key);
    if (text != kTrue && text != kFalse) FailAsDamaged(key, "true or false", text);
    return text == kTrue;
  }
  std::vector<int> Sizes(const std::string& key) {
    std::vector<int> sizes;
    const std::string text = Text(key);
    for (const absl::string_view part : absl::StrSplit(text, ',', absl::SkipEmpty())) {
      int size = 0;
      if (!absl::SimpleAtoi(part, &size) || size <= 0) FailAsDamaged(key, "sizes of layers", text);
      sizes.push_back(size);
    }
    return sizes;
  }

  const absl::Status& status() const { return status_; }

 private:
  void Fail(const absl::Status& status) { status_.Update(status); }
  void FailAsDamaged(const std::string& key, absl::string_view expected, const std::string& found) {
    Fail(absl::DataLossError(absl::StrCat(path_, " is damaged: metadata '", key, "': expected ", expected,
                                          ", found '", found, "'")));
  }

  const std::map<std::string, std::string>& metadata_;
  const std::string& path_;
  absl::Status status_;
};

}  // namespace

absl::StatusOr<TensorFile> PolicyTensors(const PolicySnapshot& snapshot) {
  TensorFile file;
  std::vector<std::string> names;
  for (const auto& [name, parameters] : snapshot.networks) {
    if (name.empty() || name.find(',') != std::string::npos ||
        !file.tensors.emplace(name, parameters).second) {
      return absl::InvalidArgumentError(absl::StrCat(
          "cannot save a policy: expected networks with names of their own, without commas, found '", name,
          "'"));
    }
    names.push_back(name);
  }
  const PolicySpec& spec = snapshot.spec;
  file.metadata = {{"env", spec.env},
                   {"algorithm", spec.algorithm},
                   {"observation_size", absl::StrCat(spec.observation_size)},
                   {"action_kind", spec.actions.discrete() ? kDiscrete : kContinuous},
                   {"action_size", absl::StrCat(spec.actions.size)},
                   {"hidden_sizes", absl::StrJoin(spec.hidden_sizes, ",")},
                   {"critic_layer_norm", spec.critic_layer_norm ? kTrue : kFalse},
                   {"version", absl::StrCat(snapshot.version)},
                   {"updates", absl::StrCat(snapshot.updates)},
                   {"support_epsilon", absl::StrFormat("%.9g", snapshot.support_epsilon)},
                   {"networks", absl::StrJoin(names, ",")}};
  return file;
}

absl::Status SavePolicy(const PolicySnapshot& snapshot, const std::string& path) {
  ASSIGN_OR_RETURN(const TensorFile file, PolicyTensors(snapshot));
  return SaveTensors(file, path);
}

absl::StatusOr<PolicySnapshot> LoadPolicy(const std::string& path) {
  ASSIGN_OR_RETURN(TensorFile file, LoadTensors(path));
  MetadataReader reader(file.metadata, path);
  PolicySnapshot snapshot;
  snapshot.spec.env = reader.Text("env");
  snapshot.spec.algorithm = reader.Text("algorithm");
  snapshot.spec.observation_size = reader.Count<int>("observation_size");
  snapshot.spec.actions.kind = reader.Kind("action_kind");
  snapshot.spec.actions.size = reader.Count<int>("action_size");
  snapshot.spec.hidden_sizes = reader.Sizes("hidden_sizes");
  snapshot.spec.critic_layer_norm = reader.Flag("critic_layer_norm");
  snapshot.version = reader.Count<std::uint64_t>("version");
  snapshot.updates = reader.Count<std::uint64_t>("updates");
  snapshot.support_epsilon = reader.Real("support_epsilon");
  const std::string names = reader.Text("networks");
  RETURN_IF_ERROR(reader.status());
  for (const absl::string_view name : absl::StrSplit(names, ',', absl::SkipEmpty())) {
    const auto tensor = file.tensors.extract(std::string(name));
    if (tensor.empty()) {
      return absl::DataLossError(
          absl::StrCat(path, " is damaged: expected network '", name, "', found none"));
    }
    snapshot.networks.emplace_back(tensor.key(), std::move(tensor.mapped()));
  }
  if (snapshot.Find(kPolicyNetwork) == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " is not a policy file: expected a network '", kPolicyNetwork, "', found none"));
  }
  return snapshot;
}

}  // namespace dbr
