#include "tests/learner/algorithms/members.h"

#include <gtest/gtest.h>

#include "nn/product/product_library.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

AlgorithmSpec DefaultSpecOf(const AlgorithmId& id, std::uint64_t seed) {
  AlgorithmSpec spec = SmallSpec(seed, id.actions);
  if (id.name == "sac") spec.config.mutable_sac();
  if (id.name == "ddqn") spec.config.mutable_ddqn();
  if (id.name == "discrete_sac") spec.config.mutable_discrete_sac();
  if (id.name == "bear") {
    BearConfig* bear = spec.config.mutable_bear();
    bear->set_warm_start_updates(2);
    bear->add_vae_hidden_sizes(8);
  }
  if (id.name == "brac") spec.config.mutable_brac()->set_variant(BracConfig::VP);
  if (id.name == "td3") spec.config.mutable_td3();
  if (id.name == "awac") spec.config.mutable_awac()->set_value_samples(3);
  if (id.name == "td3_bc") spec.config.mutable_td3_bc();
  if (id.name == "rebrac") spec.config.mutable_rebrac();
  if (id.name == "iql") spec.config.mutable_iql();
  if (id.name == "cal_ql") spec.config.mutable_cal_ql()->set_conservative_actions(3);
  EXPECT_EQ(AlgorithmName(spec.config), id.name) << "give the new algorithm its config here";
  return spec;
}

struct Variant {
  const char* name;
  const char* algorithm;
  void (*set)(AlgorithmSpec* spec);
};

constexpr Variant kVariants[] = {
    {"Sil", "dbr", [](AlgorithmSpec* spec) { spec->config.mutable_dbr()->set_advantage(DbrConfig::SIL); }},
    {"Mrl", "dbr",
     [](AlgorithmSpec* spec) {
       DbrConfig* dbr = spec->config.mutable_dbr();
       dbr->set_constraint(DbrConfig::NONE);
       dbr->set_munchausen_weight(0.9);
       dbr->set_entropy_weight(0.1);
     }},
    {"Normalized", "dbr", [](AlgorithmSpec* spec) { spec->normalize_observations = true; }},
    {"Mirrored", "dbr",
     [](AlgorithmSpec* spec) {
       spec->config.set_mirror(true);
       spec->symmetry = SmallSymmetry(spec->actions.kind);
     }},
    {"LayerNorm", "dbr", [](AlgorithmSpec* spec) { spec->critic_layer_norm = true; }},
    {"LayerNorm", "sac", [](AlgorithmSpec* spec) { spec->critic_layer_norm = true; }},
    {"LayerNorm", "discrete_sac", [](AlgorithmSpec* spec) { spec->critic_layer_norm = true; }},
    {"LayerNorm", "bear", [](AlgorithmSpec* spec) { spec->critic_layer_norm = true; }},
    {"Online", "dbr",
     [](AlgorithmSpec* spec) {
       spec->config.set_critics(4);
       DbrConfig* dbr = spec->config.mutable_dbr();
       dbr->set_first_temperature(0.5);
       dbr->set_updates_per_policy_update(3);
       dbr->set_repel_negative(true);
       dbr->set_value_penalty(true);
       dbr->set_normalize_q(true);
       dbr->set_divergence(DbrConfig::MMD_SQUARED);
       dbr->set_min_multiplier(0);
     }},
    {"Batch", "dbr",
     [](AlgorithmSpec* spec) { spec->config.mutable_dbr()->set_behavior_data(DbrConfig::BATCH); }},
    {"Actions", "dbr",
     [](AlgorithmSpec* spec) {
       if (spec->actions.discrete()) return;  // it is for continuous actions
       DbrConfig* dbr = spec->config.mutable_dbr();
       dbr->set_divergence(DbrConfig::ACTIONS);
       dbr->set_action_weights(DbrConfig::EXPONENTIAL);
     }},
    {"ActionsSil", "dbr",
     [](AlgorithmSpec* spec) {
       DbrConfig* dbr = spec->config.mutable_dbr();
       dbr->set_advantage(DbrConfig::SIL);
       if (spec->actions.discrete()) return;
       dbr->set_divergence(DbrConfig::ACTIONS);
       dbr->set_action_weights(DbrConfig::MARGIN);
     }},
    {"OneAsked", "dbr",
     [](AlgorithmSpec* spec) {
       spec->config.set_critics(3);
       spec->config.set_target_critics(1);
     }},
    {"Ensemble", "sac",
     [](AlgorithmSpec* spec) {
       spec->config.set_critics(4);
       spec->config.mutable_sac()->set_updates_per_policy_update(3);
     }},
};

}  // namespace

int CycleOf(const AlgorithmConfig& config) {
  if (config.has_dbr()) return static_cast<int>(config.dbr().updates_per_policy_update());
  if (config.has_sac()) return static_cast<int>(config.sac().updates_per_policy_update());
  return 1;
}

int EnoughFor(const AlgorithmConfig& config) {
  return config.critics() > config.target_critics() ? 60 : 4;
}

AlgorithmSpec SpecOf(const Member& member, std::uint64_t seed) {
  AlgorithmSpec spec = DefaultSpecOf(member.id, seed);
  for (const Variant& variant : kVariants) {
    if (member.variant == variant.name && member.id.name == variant.algorithm) variant.set(&spec);
  }
  spec.bfloat16 = member.bfloat16;
  return spec;
}

std::vector<Member> Members() {
  std::vector<Member> members;
  for (const bool bfloat16 : {false, true}) {
    if (bfloat16 && !HasBfloat16()) break;
    for (const AlgorithmId& id : Algorithms()) {
      members.push_back({id, "", bfloat16});
      for (const Variant& variant : kVariants) {
        if (id.name == variant.algorithm) members.push_back({id, variant.name, bfloat16});
      }
    }
  }
  return members;
}

}  // namespace dbr
