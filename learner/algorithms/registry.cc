#include "learner/algorithms/registry.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/status_macros.h"
#include "learner/algorithms/awac.h"
#include "learner/algorithms/brac.h"
#include "learner/algorithms/cal_ql.h"
#include "learner/algorithms/continuous_bear.h"
#include "learner/algorithms/continuous_dbr.h"
#include "learner/algorithms/ddqn.h"
#include "learner/algorithms/discrete_bear.h"
#include "learner/algorithms/discrete_dbr.h"
#include "learner/algorithms/discrete_sac.h"
#include "learner/algorithms/iql.h"
#include "learner/algorithms/mirrored.h"
#include "learner/algorithms/normalized.h"
#include "learner/algorithms/sac.h"
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
  // Returns InvalidArgument where a variant does not serve these actions. Null where all variants do.
  absl::Status (*check)(const AlgorithmConfig&, const std::string& env) = nullptr;
};

constexpr char kDbrSource[] = "Siu, Traish, Xu 2021";
constexpr char kDbrVariants[] =
    "constraint, divergence, advantage, repel_negative, value_penalty, munchausen_weight";
constexpr char kBearSource[] = "Kumar et al. 2019";

// The Munchausen term belongs to each reward. A transition of several steps has one sum of them, and the
// actions of its later steps are not kept.
absl::Status CheckDbr(const AlgorithmConfig& config, const std::string&) {
  if (config.n_step() == 1 || config.dbr().munchausen_weight() == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("algorithm.n_step: expected 1 with algorithm.dbr.munchausen_weight above 0, found ",
                   config.n_step(), ". Set one of the two to its default."));
}

absl::Status CheckDiscreteDbr(const AlgorithmConfig& config, const std::string& env) {
  RETURN_IF_ERROR(CheckDbr(config, env));
  if (config.dbr().divergence() != DbrConfig::ACTIONS) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("algorithm.dbr.divergence: expected one between policies for the discrete actions of "
                   "environment '",
                   env, "', found ACTIONS. Take KL or MMD_EXACT."));
}

constexpr Entry kAlgorithms[] = {
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kDiscrete, MakeDiscreteDbr, kDbrSource, kDbrVariants,
     CheckDiscreteDbr},
    {"dbr", AlgorithmConfig::kDbr, ActionKind::kContinuous, MakeContinuousDbr, kDbrSource, kDbrVariants,
     CheckDbr},
    {"bear", AlgorithmConfig::kBear, ActionKind::kDiscrete, MakeDiscreteBear, kBearSource, "divergence"},
    {"bear", AlgorithmConfig::kBear, ActionKind::kContinuous, MakeContinuousBear, kBearSource, "divergence",
     CheckContinuousBear},
    {"sac", AlgorithmConfig::kSac, ActionKind::kContinuous, MakeSac, "Haarnoja et al. 2018", ""},
    {"ddqn", AlgorithmConfig::kDdqn, ActionKind::kDiscrete, MakeDdqn, "van Hasselt et al. 2016", ""},
    {"discrete_sac", AlgorithmConfig::kDiscreteSac, ActionKind::kDiscrete, MakeDiscreteSac,
     "Christodoulou 2019", ""},
    {"brac", AlgorithmConfig::kBrac, ActionKind::kContinuous, MakeBrac, "Wu, Tucker, Nachum 2019",
     "variant, adaptive_multiplier"},
    {"td3", AlgorithmConfig::kTd3, ActionKind::kContinuous, MakeTd3, "Fujimoto, van Hoof, Meger 2018", ""},
    {"awac", AlgorithmConfig::kAwac, ActionKind::kContinuous, MakeAwac, "Nair et al. 2020", ""},
    {"td3_bc", AlgorithmConfig::kTd3Bc, ActionKind::kContinuous, MakeTd3, "Fujimoto, Gu 2021", ""},
    {"rebrac", AlgorithmConfig::kRebrac, ActionKind::kContinuous, MakeTd3, "Tarasov et al. 2023", ""},
    {"iql", AlgorithmConfig::kIql, ActionKind::kContinuous, MakeIql, "Kostrikov, Nair, Levine 2021", ""},
    {"cal_ql", AlgorithmConfig::kCalQl, ActionKind::kContinuous, MakeCalQl, "Nakamoto et al. 2023",
     "calibrated"},
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

absl::Status CheckServes(const AlgorithmConfig& config, const std::string& env, const ActionSpace& actions) {
  std::vector<std::string> serving;
  for (const Entry& entry : kAlgorithms) {
    if (entry.actions != actions.kind) continue;
    if (entry.config_case == config.algorithm_case()) {
      return entry.check == nullptr ? absl::OkStatus() : entry.check(config, env);
    }
    serving.push_back(entry.name);
  }
  const std::string name = AlgorithmName(config);
  return absl::InvalidArgumentError(absl::StrCat("config field 'algorithm': expected one that serves the ",
                                                 NameOf(actions.kind), " actions of environment '", env,
                                                 "' (", absl::StrJoin(serving, ", "), "), found ",
                                                 name.empty() ? "none" : name));
}

absl::StatusOr<std::unique_ptr<Algorithm>> MakeAlgorithm(const AlgorithmSpec& spec) {
  RETURN_IF_ERROR(CheckServes(spec.config, spec.env, spec.actions));
  RETURN_IF_ERROR(CheckMirror(spec.config, {.name = spec.env,
                                            .observation_size = spec.observation_size,
                                            .actions = spec.actions,
                                            .symmetry = spec.symmetry}));
  const Entry* entry =
      std::find_if(std::begin(kAlgorithms), std::end(kAlgorithms), [&spec](const Entry& one) {
        return one.actions == spec.actions.kind && one.config_case == spec.config.algorithm_case();
      });
  std::unique_ptr<Algorithm> algorithm = entry->make(spec);
  if (spec.normalize_observations) algorithm = Normalized(spec, std::move(algorithm));
  if (spec.config.mirror()) algorithm = Mirrored(spec, std::move(algorithm));
  return algorithm;
}

}  // namespace dbr
