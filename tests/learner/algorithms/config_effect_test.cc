// Tests that every field of an algorithm's config has an effect: with another value, a few updates give other
// networks.
#include <gmock/gmock.h>
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

constexpr int kUpdates = 8;

// A value of a field that is not its default, and the other fields that make it matter. A field may have
// several.
struct Effect {
  const char* algorithm;  // the member of AlgorithmConfig's oneof
  const char* field;
  const char* value;       // "a: 1"
  const char* where = "";  // other fields, in text format
};

constexpr Effect kEffects[] = {
    {"dbr", "constraint", "constraint: DYNAMIC_MIN",
     "first_multiplier: 50 epsilon: 1e-6 repel_negative: true"},
    {"dbr", "constraint", "constraint: FIXED", "first_multiplier: 50 epsilon: 1e-6 repel_negative: true"},
    {"dbr", "constraint", "constraint: NONE"},
    {"dbr", "divergence", "divergence: MMD_EXACT"},
    {"dbr", "divergence", "divergence: ACTIONS"},
    {"dbr", "epsilon", "epsilon: 10", "constraint: FIXED multiplier_learning_rate: 0.1"},
    {"dbr", "repel_negative", "repel_negative: true", "epsilon: 1e-6"},
    {"dbr", "value_penalty", "value_penalty: true"},
    {"dbr", "first_multiplier", "first_multiplier: 2"},
    {"dbr", "multiplier_learning_rate", "multiplier_learning_rate: 0.1"},
    {"dbr", "normalize_q", "normalize_q: true"},
    {"dbr", "warm_start_updates", "warm_start_updates: 4"},
    {"dbr", "mmd_sigma", "mmd_sigma: 5", "divergence: MMD_EXACT"},
    {"dbr", "target_min_weight", "target_min_weight: 1"},
    {"dbr", "entropy_weight", "entropy_weight: 0.5"},
    {"dbr", "behavior_batch_size", "behavior_batch_size: 8"},
    {"dbr", "target_samples", "target_samples: 3"},
    {"dbr", "policy_samples", "policy_samples: 2"},
    {"dbr", "divergence_samples", "divergence_samples: 3", "divergence: MMD_LAPLACIAN"},
    {"dbr", "advantage",
     "advantage: SIL"},  // the replay server applies ARM_CUMULATIVE (tests/learner/runtime/trainer_test.cc)
    {"dbr", "munchausen_weight", "munchausen_weight: 0.9"},
    {"dbr", "first_temperature", "first_temperature: 0.5"},
    {"dbr", "temperature_learning_rate", "temperature_learning_rate: 0.1", "first_temperature: 1"},
    {"dbr", "target_entropy", "target_entropy: 5", "first_temperature: 1 temperature_learning_rate: 0.1"},
    {"dbr", "target_entropy_ratio", "target_entropy_ratio: 0.1",
     "first_temperature: 1 temperature_learning_rate: 0.1"},
    {"dbr", "max_repulsion", "max_repulsion: 1e-3", "repel_negative: true epsilon: 1e-6"},
    {"dbr", "min_multiplier", "min_multiplier: 0.9", "multiplier_learning_rate: 0.1 epsilon: 10"},
    {"dbr", "max_multiplier", "max_multiplier: 1.1",
     "multiplier_learning_rate: 0.1 constraint: FIXED epsilon: 1e-6"},
    {"dbr", "updates_per_policy_update", "updates_per_policy_update: 3"},
    {"dbr", "behavior_data", "behavior_data: BATCH"},
    {"dbr", "minus_margin", "minus_margin: 0.5", "behavior_data: BATCH"},  // PARTITIONS: the replay server's

    {"dbr", "minus_margin", "minus_margin: 0.2", "divergence: ACTIONS repel_negative: true epsilon: 1e-6"},
    {"dbr", "action_weights", "action_weights: MARGIN", "divergence: ACTIONS constraint: FIXED"},
    {"dbr", "action_weights", "action_weights: EXPONENTIAL", "divergence: ACTIONS constraint: FIXED"},
    {"dbr", "plus_margin", "plus_margin: 0.2",
     "divergence: ACTIONS constraint: FIXED action_weights: MARGIN"},
    {"dbr", "advantage_temperature", "advantage_temperature: 0.3",
     "divergence: ACTIONS constraint: FIXED action_weights: EXPONENTIAL"},
    {"dbr", "max_action_weight", "max_action_weight: 1.1",
     "divergence: ACTIONS constraint: FIXED action_weights: EXPONENTIAL"},

    {"sac", "first_temperature", "first_temperature: 0.1"},
    {"sac", "temperature_learning_rate", "temperature_learning_rate: 0.1"},
    {"sac", "target_entropy", "target_entropy: 5", "temperature_learning_rate: 0.1"},
    {"sac", "updates_per_policy_update", "updates_per_policy_update: 3"},

    {"bear", "divergence", "divergence: MMD_GAUSSIAN"},
    {"bear", "divergence", "divergence: KL"},
    {"bear", "epsilon", "epsilon: 10", "multiplier_learning_rate: 0.1"},
    {"bear", "mmd_sigma", "mmd_sigma: 1"},
    {"bear", "divergence_samples", "divergence_samples: 3"},
    {"bear", "first_multiplier", "first_multiplier: 2", "warm_start_updates: 0"},
    {"bear", "multiplier_learning_rate", "multiplier_learning_rate: 0.1", "warm_start_updates: 0"},
    {"bear", "warm_start_updates", "warm_start_updates: 4"},
    {"bear", "target_min_weight", "target_min_weight: 1"},
    {"bear", "target_samples", "target_samples: 3"},
    {"bear", "policy_samples", "policy_samples: 3", "warm_start_updates: 0"},
    {"bear", "vae_hidden_sizes", "vae_hidden_sizes: [8, 8]"},
    {"bear", "vae_kl_weight", "vae_kl_weight: 2"},
    {"bear", "vae_latent_limit", "vae_latent_limit: 0.1"},
    {"bear", "entropy_weight", "entropy_weight: 0.5", "warm_start_updates: 0"},

    {"brac", "variant", "variant: VP"},
    {"brac", "first_multiplier", "first_multiplier: 2"},
    {"brac", "adaptive_multiplier", "adaptive_multiplier: true", "multiplier_learning_rate: 0.1"},
    {"brac", "epsilon", "epsilon: 100", "adaptive_multiplier: true multiplier_learning_rate: 0.1"},
    {"brac", "multiplier_learning_rate", "multiplier_learning_rate: 0.1", "adaptive_multiplier: true"},
    {"brac", "divergence_samples", "divergence_samples: 2"},
    {"brac", "target_min_weight", "target_min_weight: 1"},
    {"brac", "warm_start_updates", "warm_start_updates: 4"},

    {"td3", "target_noise", "target_noise: 0.4"},
    {"td3", "target_noise_limit", "target_noise_limit: 0.1"},
    {"td3", "policy_delay", "policy_delay: 3"},

    {"td3_bc", "target_noise", "target_noise: 0.4"},
    {"td3_bc", "target_noise_limit", "target_noise_limit: 0.1"},
    {"td3_bc", "policy_delay", "policy_delay: 3"},
    {"td3_bc", "q_weight", "q_weight: 5"},

    {"rebrac", "target_noise", "target_noise: 0.4"},
    {"rebrac", "target_noise_limit", "target_noise_limit: 0.1"},
    {"rebrac", "policy_delay", "policy_delay: 3"},
    {"rebrac", "policy_penalty", "policy_penalty: 1"},
    {"rebrac", "critic_penalty", "critic_penalty: 0.5"},

    {"iql", "expectile", "expectile: 0.9"},
    {"iql", "temperature", "temperature: 0.1"},
    {"iql", "max_weight", "max_weight: 0.5"},

    {"cal_ql", "first_temperature", "first_temperature: 0.1"},
    {"cal_ql", "temperature_learning_rate", "temperature_learning_rate: 0.1"},
    {"cal_ql", "target_entropy", "target_entropy: 5", "temperature_learning_rate: 0.1"},
    {"cal_ql", "conservative_weight", "conservative_weight: 1"},
    {"cal_ql", "conservative_actions", "conservative_actions: 3"},
    {"cal_ql", "calibrated", "calibrated: false"},

    {"awac", "temperature", "temperature: 0.2"},
    {"awac", "max_weight", "max_weight: 0.5"},
    {"awac", "value_samples", "value_samples: 3"},

    {"discrete_sac", "first_temperature", "first_temperature: 0.1"},
    {"discrete_sac", "temperature_learning_rate", "temperature_learning_rate: 0.1"},
    {"discrete_sac", "target_entropy_ratio", "target_entropy_ratio: 0.1", "temperature_learning_rate: 0.1"},
};

AlgorithmSpec SpecOf(const std::string& algorithm, const std::string& settings, ActionKind actions) {
  AlgorithmSpec spec = SmallSpec(1, actions);
  spec.config.clear_algorithm();
  const std::string text = absl::StrCat(algorithm, " { ", settings, " }");
  AlgorithmConfig algorithm_alone;
  EXPECT_TRUE(google::protobuf::TextFormat::ParseFromString(text, &algorithm_alone)) << text;
  spec.config.MergeFrom(algorithm_alone);
  return spec;
}

using Networks = std::vector<std::pair<std::string, std::vector<float>>>;

// Returns the exported networks after kUpdates updates on batches that the random seed decides. Empty where
// the algorithm does not serve these actions, or not with these settings.
Networks Train(const AlgorithmSpec& spec) {
  const auto algorithm = MakeAlgorithm(spec);
  if (!algorithm.ok()) return {};
  const BatchNeeds needs = (*algorithm)->needs();
  for (int i = 0; i < kUpdates; ++i) {
    const auto draw = [&](int n, std::uint64_t stream) {
      Rng rng(10 * static_cast<std::uint64_t>(i) + stream);
      return RandomBatch<float>(spec, n, rng);
    };
    const Batch uniform = draw(needs.uniform, 1), plus = draw(needs.plus, 2), minus = draw(needs.minus, 3);
    const absl::Status status = (*algorithm)->Update({uniform, plus, minus});
    EXPECT_TRUE(status.ok()) << status;
  }
  PolicySnapshot snapshot;
  (*algorithm)->ExportPolicy(&snapshot);
  return snapshot.networks;
}

std::set<std::string> RegisteredNames() {
  std::set<std::string> names;
  for (const AlgorithmId& id : Algorithms()) names.insert(id.name);
  return names;
}

const google::protobuf::Descriptor& ConfigOf(const std::string& algorithm) {
  return *AlgorithmConfig::descriptor()->FindFieldByName(algorithm)->message_type();
}

TEST(ConfigEffectTest, EveryFieldOfEveryAlgorithmIsInTheTable) {
  for (const std::string& algorithm : RegisteredNames()) {
    const google::protobuf::Descriptor& config = ConfigOf(algorithm);
    for (int i = 0; i < config.field_count(); ++i) {
      const std::string& field = config.field(i)->name();
      EXPECT_TRUE(std::any_of(
          std::begin(kEffects), std::end(kEffects),
          [&](const Effect& effect) { return algorithm == effect.algorithm && field == effect.field; }))
          << algorithm << "." << field << ": name a value of it in this test's table that has an effect";
    }
  }
}

TEST(ConfigEffectTest, TheTableNamesFieldsThatThereAre) {
  for (const Effect& effect : kEffects) {
    SCOPED_TRACE(absl::StrCat(effect.algorithm, ".", effect.value));
    const auto* const field = ConfigOf(effect.algorithm).FindFieldByName(effect.field);
    ASSERT_NE(field, nullptr);
    EXPECT_EQ(std::string(effect.value).rfind(absl::StrCat(effect.field, ":"), 0), 0u);
    EXPECT_THAT(std::string(effect.where), testing::Not(testing::HasSubstr(absl::StrCat(effect.field, ":"))));
  }
}

// The field of NetworkConfig that an algorithm reads through its spec.
TEST(ConfigEffectTest, CriticLayerNormChangesTheCriticsAndWhatIsLearned) {
  for (const ActionKind actions : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    AlgorithmSpec spec = SpecOf("dbr", "", actions);
    const Networks base = Train(spec);
    spec.critic_layer_norm = true;
    const Networks changed = Train(spec);
    ASSERT_EQ(base.size(), changed.size());
    for (std::size_t i = 0; i < base.size(); ++i) {
      const auto& [name, parameters] = changed[i];
      const bool critic = name == kCritic1 || name == kCritic2;
      // A gain and a shift for each unit of two layers of 8.
      EXPECT_EQ(parameters.size(), base[i].second.size() + (critic ? 32 : 0)) << name;
    }
    EXPECT_EQ(base[0].first, kPolicyNetwork);
    EXPECT_NE(base[0].second, changed[0].second);
  }
}

class ConfigEffect : public testing::TestWithParam<Effect> {};

TEST_P(ConfigEffect, ChangesWhatIsLearned) {
  const Effect& effect = GetParam();
  if (RegisteredNames().count(effect.algorithm) == 0)
    GTEST_SKIP() << effect.algorithm << " is not in this build";
  int served = 0;
  bool changes = false;
  for (const ActionKind actions : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    const Networks base = Train(SpecOf(effect.algorithm, effect.where, actions));
    const Networks changed =
        Train(SpecOf(effect.algorithm, absl::StrCat(effect.where, " ", effect.value), actions));
    if (base.empty() || changed.empty()) continue;
    ++served;
    changes = changes || base != changed;
  }
  EXPECT_GT(served, 0) << "no kind of action is served with these settings";
  EXPECT_TRUE(changes) << effect.algorithm << ": " << effect.value << " has no effect where " << effect.where;
}

TEST(ConfigEffectTest, ImagesUnderASymmetryChangeWhatIsLearned) {
  for (const ActionKind actions : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    AlgorithmSpec spec = SmallSpec(1, actions);
    spec.symmetry = SmallSymmetry(actions);
    const Networks base = Train(spec);
    spec.config.set_mirror(true);
    const Networks changed = Train(spec);
    ASSERT_FALSE(base.empty() || changed.empty());
    EXPECT_NE(base, changed);
  }
}

std::string NameOf(const testing::TestParamInfo<Effect>& info) {
  std::string name = absl::StrCat(info.param.algorithm, "_", info.param.value);
  for (char& letter : name) {
    if (!std::isalnum(static_cast<unsigned char>(letter))) letter = '_';
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Table, ConfigEffect, testing::ValuesIn(kEffects), NameOf);

}  // namespace
}  // namespace dbr
