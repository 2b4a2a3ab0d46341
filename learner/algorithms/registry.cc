// The table of algorithms: one line for each.
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "learner/algorithm.h"
#include "learner/algorithms/continuous_dbr.h"
#include "learner/algorithms/discrete_dbr.h"
#include "learner/algorithms/normalized.h"
#include "learner/algorithms/sac.h"

namespace dbr {
namespace {

struct Entry {
  const char* name;
  AlgorithmConfig::AlgorithmCase config_case;
  ActionKind actions;
  std::unique_ptr<Algorithm> (*make)(const AlgorithmSpec&);
};

constexpr Entry kAlgorithms[] = {
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kDiscrete, MakeDiscreteDbr},
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kContinuous, MakeContinuousDbr},
    {"sac", AlgorithmConfig::kSac, ActionKind::kContinuous, MakeSac},
};

// Options that serve one kind of action alone.
absl::Status CheckOptions(const AlgorithmSpec& spec) {
  const DbrConfig& dbr = spec.config.dbr();
  if (spec.actions.discrete() && IsSampled(dbr.divergence())) {
    return absl::InvalidArgumentError(
        absl::StrCat("algorithm.dbr.divergence: expected KL or MMD_EXACT for the discrete actions of '",
                     spec.env, "', found ", DbrConfig::Divergence_Name(dbr.divergence())));
  }
  return absl::OkStatus();
}

const char* NameOf(ActionKind kind) {
  return kind == ActionKind::kDiscrete ? "discrete" : "continuous";
}

}  // namespace

std::vector<AlgorithmId> Algorithms() {
  std::vector<AlgorithmId> algorithms;
  for (const Entry& entry : kAlgorithms) algorithms.push_back({entry.name, entry.actions});
  return algorithms;
}

std::string AlgorithmName(const AlgorithmConfig& config) {
  for (const Entry& entry : kAlgorithms) {
    if (entry.config_case == config.algorithm_case()) return entry.name;
  }
  return "";
}

absl::StatusOr<std::unique_ptr<Algorithm>> MakeAlgorithm(const AlgorithmSpec& spec) {
  std::vector<std::string> serving;
  for (const Entry& entry : kAlgorithms) {
    if (entry.actions != spec.actions.kind) continue;
    serving.push_back(entry.name);
    if (entry.config_case != spec.config.algorithm_case()) continue;
    if (absl::Status status = CheckOptions(spec); !status.ok()) return status;
    std::unique_ptr<Algorithm> algorithm = entry.make(spec);
    return spec.normalize_observations ? Normalized(spec, std::move(algorithm)) : std::move(algorithm);
  }
  const std::string name = AlgorithmName(spec.config);
  return absl::InvalidArgumentError(absl::StrCat("config field 'algorithm': expected one that serves the ",
                                                 NameOf(spec.actions.kind), " actions of environment '",
                                                 spec.env, "' (", absl::StrJoin(serving, ", "), "), found ",
                                                 name.empty() ? "none" : name));
}

}  // namespace dbr
