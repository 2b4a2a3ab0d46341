#include "proto/config/config_combinations.h"

#include "absl/strings/str_cat.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

void CheckMultiplier(const DbrConfig& dbr, std::vector<std::string>* errors) {
  const double min = dbr.min_multiplier(), max = dbr.max_multiplier();
  if (min > max) {
    errors->push_back(absl::StrCat("algorithm.dbr.min_multiplier: expected at most max_multiplier (", max,
                                   "), found ", min));
  } else if (dbr.first_multiplier() < min || dbr.first_multiplier() > max) {
    errors->push_back(absl::StrCat("algorithm.dbr.first_multiplier: expected min_multiplier (", min,
                                   ") to max_multiplier (", max, "), found ", dbr.first_multiplier()));
  }
}

void CheckTemperature(const DbrConfig& dbr, std::vector<std::string>* errors) {
  if (dbr.first_temperature() == 0) return;
  if (dbr.entropy_weight() > 0) {
    errors->push_back(
        absl::StrCat("algorithm.dbr.entropy_weight: expected 0 with a first_temperature above 0, which "
                     "weighs the entropy in its place, found ",
                     dbr.entropy_weight()));
  }
  const bool has_target = dbr.has_target_entropy() || dbr.has_target_entropy_ratio();
  if (dbr.constraint() == DbrConfig::NONE && !has_target) {
    errors->emplace_back(
        "algorithm.dbr.target_entropy: expected a value where constraint is NONE and first_temperature is "
        "above 0 (or target_entropy_ratio for discrete actions), found none");
  }
}

void CheckActions(const DbrConfig& dbr, std::vector<std::string>* errors) {
  const bool actions = dbr.divergence() == DbrConfig::ACTIONS;
  if (actions && dbr.value_penalty()) {
    errors->emplace_back(
        "algorithm.dbr.value_penalty: expected false with divergence: ACTIONS, which knows no action at the "
        "next "
        "state, found true");
  }
  if (!actions && dbr.action_weights() != DbrConfig::ALL) {
    errors->push_back(
        absl::StrCat("algorithm.dbr.action_weights: expected divergence: ACTIONS with it, found ",
                     DbrConfig::ActionWeights_Name(dbr.action_weights()),
                     " and divergence: ", DbrConfig::Divergence_Name(dbr.divergence())));
  }
}

void CheckDbr(const Config& config, std::vector<std::string>* errors) {
  const DbrConfig& dbr = config.algorithm().dbr();
  CheckMultiplier(dbr, errors);
  CheckTemperature(dbr, errors);
  CheckActions(dbr, errors);
  // A config that was printed with all of its fields has the default here.
  if (!dbr.repel_negative() && dbr.max_repulsion() != DbrConfig::default_instance().max_repulsion()) {
    errors->push_back(absl::StrCat("algorithm.dbr.max_repulsion: expected repel_negative: true with it, ",
                                   "found ", dbr.max_repulsion(), " and repel_negative: false"));
  }
  if (dbr.behavior_data() == DbrConfig::BATCH && dbr.advantage() == DbrConfig::SIL) {
    errors->emplace_back(
        "algorithm.dbr.behavior_data: expected PARTITIONS with advantage: SIL, which fits beta+ to the batch "
        "in its own way, found BATCH");
  }
  if (dbr.munchausen_weight() > 0 && config.algorithm().n_step() > 1) {
    errors->push_back(
        absl::StrCat("algorithm.n_step: expected 1 with a munchausen_weight above 0, which raises the reward "
                     "of a single step, found ",
                     config.algorithm().n_step()));
  }
}

void CheckShare(const SeedBufferConfig& seed_buffer, std::vector<std::string>* errors) {
  if (seed_buffer.final_share() > 0 && seed_buffer.share_decay_transitions() == 0) {
    errors->push_back(absl::StrCat(
        "replay.seed_buffer.share_decay_transitions: expected above 0 with a final_share, found 0 and ",
        "final_share: ", seed_buffer.final_share()));
  }
}

bool IsGiven(const ScheduleConfig& schedule) {
  return schedule.updates() > 0 || schedule.first() != 0 || schedule.last() != 0;
}

// `positive`: whether the values are above 0, as those that move geometrically.
void CheckSchedule(const Config& config, const char* name, const ScheduleConfig& schedule, bool positive,
                   std::vector<std::string>* errors) {
  if (!IsGiven(schedule)) return;
  const std::string field = absl::StrCat("finetune.", name);
  if (schedule.updates() == 0) {
    errors->push_back(absl::StrCat(field, ".updates: expected above 0 with first and last, found 0: the ",
                                   "schedule would end before it begins"));
  }
  if (positive && (schedule.first() <= 0 || schedule.last() <= 0)) {
    errors->push_back(absl::StrCat(field, ": expected first and last above 0, found ", schedule.first(),
                                   " and ", schedule.last()));
  }
  if (!config.algorithm().has_dbr()) {
    errors->push_back(absl::StrCat(field, ": expected algorithm dbr with it, which alone has schedules"));
    return;
  }
  const DbrConfig& dbr = config.algorithm().dbr();
  const bool of_multiplier = &schedule == &config.finetune().multiplier();
  if (of_multiplier && dbr.constraint() == DbrConfig::NONE) {
    errors->push_back(absl::StrCat(field, ": expected a constraint other than NONE with it, found NONE"));
  }
  if (!of_multiplier && dbr.first_temperature() == 0) {
    errors->push_back(
        absl::StrCat(field, ": expected algorithm.dbr.first_temperature above 0 with it, found 0"));
  }
}

void CheckFinetune(const Config& config, std::vector<std::string>* errors) {
  const FinetuneConfig& finetune = config.finetune();
  if (finetune.mode() == FinetuneConfig::NONE) {
    if (IsGiven(finetune.multiplier()) || IsGiven(finetune.temperature()) ||
        IsGiven(finetune.target_entropy())) {
      errors->emplace_back("finetune.mode: expected RETAIN, WARM_START or AUTO with a schedule, found NONE");
    }
    return;
  }
  const LearnerConfig& learner = config.learner();
  if (learner.offline_updates() == 0 || TrainsOfflineAlone(config)) {
    errors->push_back(absl::StrCat("finetune.mode: expected NONE, or learner.offline_updates above 0 and ",
                                   "learner.max_updates beyond them, found ",
                                   FinetuneConfig::Mode_Name(finetune.mode()), " with ",
                                   learner.offline_updates(), " and ", learner.max_updates()));
  }
  const SeedBufferConfig& seed_buffer = config.replay().seed_buffer();
  if (seed_buffer.share() > 0 || seed_buffer.share_decay_transitions() > 0) {
    errors->push_back(absl::StrCat("replay.seed_buffer.share: expected 0 and no decay with finetune.mode: ",
                                   FinetuneConfig::Mode_Name(finetune.mode()),
                                   ", which sets the share, found ", seed_buffer.share(), " and ",
                                   seed_buffer.share_decay_transitions(), " transitions"));
  }
  CheckSchedule(config, "multiplier", finetune.multiplier(), /*positive=*/true, errors);
  CheckSchedule(config, "temperature", finetune.temperature(), /*positive=*/true, errors);
  CheckSchedule(config, "target_entropy", finetune.target_entropy(), /*positive=*/false, errors);
  if (IsGiven(finetune.temperature()) && IsGiven(finetune.target_entropy())) {
    errors->emplace_back(
        "finetune.target_entropy: expected none with finetune.temperature, which is then not learned, found "
        "both");
  }
}

// Double DQN has one network, which is its policy and its critic.
void CheckDdqn(const Config& config, std::vector<std::string>* errors) {
  const AlgorithmConfig &algorithm = config.algorithm(), &defaults = AlgorithmConfig::default_instance();
  if (algorithm.critics() != defaults.critics() || algorithm.target_critics() != defaults.target_critics()) {
    errors->push_back(absl::StrCat("algorithm.critics: expected ", defaults.critics(), " of which ",
                                   defaults.target_critics(),
                                   " are asked with ddqn, whose one network is its ", "critic, found ",
                                   algorithm.critics(), " of which ", algorithm.target_critics()));
  }
  if (config.network().critic_layer_norm()) {
    errors->emplace_back(
        "network.critic_layer_norm: expected false with ddqn, whose one network is its policy too, found "
        "true");
  }
}

}  // namespace

void FindContradictions(const Config& config, std::vector<std::string>* errors) {
  const AlgorithmConfig& algorithm = config.algorithm();
  if (algorithm.target_critics() > algorithm.critics()) {
    errors->push_back(absl::StrCat("algorithm.target_critics: expected at most algorithm.critics (",
                                   algorithm.critics(), "), found ", algorithm.target_critics()));
  }
  if (algorithm.has_ddqn()) CheckDdqn(config, errors);
  if (algorithm.has_dbr()) CheckDbr(config, errors);
  if (algorithm.has_bear() && algorithm.bear().divergence() == DbrConfig::ACTIONS) {
    errors->emplace_back(
        "algorithm.bear.divergence: expected one between policies, for ACTIONS is for dbr alone, found "
        "ACTIONS");
  }
  CheckShare(config.replay().seed_buffer(), errors);
  CheckFinetune(config, errors);
}

}  // namespace dbr
