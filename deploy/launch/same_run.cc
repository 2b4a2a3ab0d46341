#include "deploy/launch/same_run.h"

#include <google/protobuf/util/message_differencer.h>

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

// What must be equal for one run to go on as another.
Config Identity(const Config& config) {
  const Config whole = WithDefaults(config);
  Config identity;
  identity.set_seed(whole.seed());
  *identity.mutable_env() = whole.env();
  *identity.mutable_network() = whole.network();
  identity.mutable_network()->clear_precision();
  *identity.mutable_algorithm() = whole.algorithm();
  identity.mutable_algorithm()->clear_learning_rate();
  identity.mutable_algorithm()->clear_learning_rate_decay_updates();
  identity.mutable_algorithm()->clear_final_learning_rate();
  identity.mutable_algorithm()->clear_threads();
  identity.mutable_replay()->set_capacity(whole.replay().capacity());
  identity.mutable_replay()->set_byte_budget(whole.replay().byte_budget());
  *identity.mutable_replay()->mutable_seed_buffer() = whole.replay().seed_buffer();
  identity.mutable_replay()->mutable_seed_buffer()->clear_share();
  return identity;
}

// What differs between two messages of one type, as "path: before -> now" lines.
std::string Differences(const google::protobuf::Message& before, const google::protobuf::Message& now) {
  google::protobuf::util::MessageDifferencer differencer;
  differencer.set_message_field_comparison(google::protobuf::util::MessageDifferencer::EQUIVALENT);
  std::string report;
  differencer.ReportDifferencesToString(&report);
  return differencer.Compare(before, now) ? "" : report;
}

}  // namespace

absl::Status CheckSameRun(const Config& before, const Config& now) {
  const std::string differing = Differences(Identity(before), Identity(now));
  if (differing.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("these fields differ from its config.textproto (before -> now):\n", differing,
                   "Resume without the new values, or start a new run."));
}

Config OutcomeConfig(const Config& config) {
  Config outcome = config;
  outcome.mutable_algorithm()->clear_threads();
  ReplayConfig* replay = outcome.mutable_replay();
  replay->clear_address();
  replay->clear_allow_insecure();
  replay->mutable_seed_buffer()->set_path(
      std::filesystem::path(replay->seed_buffer().path()).filename().string());
  LearnerConfig* learner = outcome.mutable_learner();
  learner->clear_address();
  learner->clear_allow_insecure();
  learner->clear_checkpoint_every_s();
  learner->clear_keep_checkpoints();
  outcome.mutable_launch()->clear_max_restarts();
  outcome.mutable_launch()->clear_restart_window_s();
  return WithDefaults(outcome);
}

std::string DifferencesOfOutcome(const Config& before, const Config& now) {
  return Differences(OutcomeConfig(before), OutcomeConfig(now));
}

}  // namespace dbr
