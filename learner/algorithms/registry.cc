// The table of algorithms: one line for each.
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "learner/algorithm.h"
#include "learner/algorithms/awac.h"
#include "learner/algorithms/brac.h"
#include "learner/algorithms/continuous_bear.h"
#include "learner/algorithms/continuous_dbr.h"
#include "learner/algorithms/ddqn.h"
#include "learner/algorithms/discrete_bear.h"
#include "learner/algorithms/discrete_dbr.h"
#include "learner/algorithms/normalized.h"
#include "learner/algorithms/sac.h"
#include "learner/algorithms/sac_discrete.h"
#include "learner/algorithms/td3.h"

namespace dbr {
namespace {

struct Entry {
  const char* name;
  AlgorithmConfig::AlgorithmCase config_case;
  ActionKind actions;
  std::unique_ptr<Algorithm> (*make)(const AlgorithmSpec&);
  const char* source;    // the publication
  const char* variants;  // the fields of its config message that choose between variants
  // InvalidArgument where a variant does not serve these actions; null: all do.
  absl::Status (*check)(const AlgorithmSpec&) = nullptr;
};

constexpr char kDbrSource[] = "Siu, Traish, Xu 2021";
constexpr char kDbrVariants[] =
    "constraint, divergence, advantage, repel_negative, value_penalty, munchausen_weight";
constexpr char kBearSource[] = "Kumar et al. 2019";

constexpr Entry kAlgorithms[] = {
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kDiscrete, MakeDiscreteDbr, kDbrSource, kDbrVariants},
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kContinuous, MakeContinuousDbr, kDbrSource, kDbrVariants},
    {"bear", AlgorithmConfig::kBear, ActionKind::kDiscrete, MakeDiscreteBear, kBearSource, "divergence"},
    {"bear", AlgorithmConfig::kBear, ActionKind::kContinuous, MakeContinuousBear, kBearSource, "divergence",
     CheckContinuousBear},
    {"sac", AlgorithmConfig::kSac, ActionKind::kContinuous, MakeSac, "Haarnoja et al. 2018", ""},
    {"ddqn", AlgorithmConfig::kDdqn, ActionKind::kDiscrete, MakeDdqn, "van Hasselt et al. 2016", ""},
    {"sac_discrete", AlgorithmConfig::kSacDiscrete, ActionKind::kDiscrete, MakeSacDiscrete,
     "Christodoulou 2019", ""},
    {"brac", AlgorithmConfig::kBrac, ActionKind::kContinuous, MakeBrac, "Wu, Tucker, Nachum 2019",
     "variant, adaptive_multiplier"},
    {"td3", AlgorithmConfig::kTd3, ActionKind::kContinuous, MakeTd3, "Fujimoto, van Hoof, Meger 2018", ""},
    {"awac", AlgorithmConfig::kAwac, ActionKind::kContinuous, MakeAwac, "Nair et al. 2020", ""},
};

const char* NameOf(ActionKind kind) {
  return kind == ActionKind::kDiscrete ? "discrete" : "continuous";
}

}  // namespace

std::vector<AlgorithmId> Algorithms() {
  std::vector<AlgorithmId> algorithms;
  for (const Entry& entry : kAlgorithms)
    algorithms.push_back({entry.name, entry.actions, entry.source, entry.variants});
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
    if (entry.check != nullptr) {
      if (absl::Status status = entry.check(spec); !status.ok()) return status;
    }
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
