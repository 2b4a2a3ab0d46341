#include "learner/runtime/finetune.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <thread>

#include "proto/config/config_file.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

// 1,000 offline updates, and schedules over 100 and 200 online ones.
Config ConfigOf(const std::string& mode) {
  return ParseConfig(
             "learner { offline_updates: 1000 } algorithm { dbr { first_temperature: 0.5 } } finetune { "
             "mode: " +
             mode +
             " retained_share: 0.25 first_transitions: 300 multiplier { first: 100 last: 1 updates: 100 } "
             "target_entropy { first: -4 last: -1 updates: 200 } }")
      .value();
}

EvaluationReport Report(std::uint64_t updates, double return_mean) {
  EvaluationReport report;
  report.set_updates(updates);
  report.set_return_mean(return_mean);
  return report;
}

double MetricOf(const Finetune& finetune, const std::string& name) {
  for (const auto& [key, value] : finetune.Metrics()) {
    if (key == name) return value;
  }
  ADD_FAILURE() << name;
  return 0;
}

TEST(Finetune, WithoutAModeThereIsNothingBetweenThePhases) {
  Config config;
  config.mutable_learner()->set_offline_updates(1000);
  Finetune finetune(config);
  EXPECT_FALSE(finetune.IsBetweenPhases(1000));
  EXPECT_FALSE(finetune.terms().seed_buffer_share.has_value());
  EXPECT_FALSE(finetune.ControlsAt(2000).multiplier.has_value());
  EXPECT_TRUE(finetune.Metrics().empty());
}

TEST(Finetune, RetainKeepsItsShareAndWarmStartNone) {
  for (const bool retains : {true, false}) {
    Finetune finetune(ConfigOf(retains ? "RETAIN" : "WARM_START"));
    EXPECT_FALSE(finetune.IsBetweenPhases(999));
    EXPECT_TRUE(finetune.IsBetweenPhases(1000));
    EXPECT_FALSE(finetune.terms().seed_buffer_share.has_value()) << "offline";
    finetune.Decide(1000, 500);
    EXPECT_FALSE(finetune.IsBetweenPhases(1000));
    EXPECT_EQ(finetune.terms().seed_buffer_share, retains ? 0.25 : 0);
    EXPECT_EQ(finetune.terms().first_transitions, 300u);
    EXPECT_THAT(finetune.Text(), HasSubstr(retains ? "RETAIN, the seed buffer keeps 25%" : "WARM_START"));
  }
}

TEST(Finetune, AutoLeavesADataBehindThatItsPolicyHasReached) {
  const auto share = [](double offline_return, double seed_buffer_return) {
    Finetune finetune(ConfigOf("AUTO"));
    finetune.set_seed_buffer_return(seed_buffer_return);
    finetune.Decide(1000, offline_return);
    EXPECT_THAT(finetune.Text(), HasSubstr("mean return of"));
    return *finetune.terms().seed_buffer_share;
  };
  EXPECT_EQ(share(501, 500), 0);
  EXPECT_EQ(share(499, 500), 0.25);
  EXPECT_EQ(share(499, std::nan("")), 0.25) << "no whole episode";
}

TEST(Finetune, WaitsForTheEvaluationOfTheOfflinePolicyItself) {
  Finetune finetune(ConfigOf("AUTO"));
  finetune.Observe(Report(1000, 42));
  finetune.Observe(Report(900, 7));
  std::thread later([&] { finetune.Observe(Report(1000, 43)); });
  EXPECT_EQ(finetune.AwaitOfflineReturn(1000), 43);
  later.join();
  std::thread closer([&] { finetune.Close(); });
  EXPECT_FALSE(finetune.AwaitOfflineReturn(1000).has_value());
  closer.join();
}

TEST(Finetune, SchedulesMoveFromTheEndOfTheOfflinePhase) {
  Finetune finetune(ConfigOf("RETAIN"));
  const auto expect = [&](std::uint64_t updates, double multiplier, double target_entropy) {
    const UpdateControls controls = finetune.ControlsAt(updates);
    EXPECT_NEAR(*controls.multiplier, multiplier, 1e-9) << updates;
    EXPECT_NEAR(*controls.target_entropy, target_entropy, 1e-9) << updates;
    EXPECT_FALSE(controls.temperature.has_value());
  };
  expect(0, 100, -4);
  expect(1000, 100, -4);
  finetune.Decide(1000, 500);
  expect(1000, 100, -4);
  expect(1050, 10, -3.25);  // half of the way, geometrically
  expect(1100, 1, -2.5);
  expect(1200, 1, -1);
  expect(5000, 1, -1);
  EXPECT_EQ(MetricOf(finetune, "finetune/progress"), 1);
}

TEST(Finetune, TheGuardBeginsTheSchedulesAnew) {
  Finetune finetune(ConfigOf("RETAIN"));
  finetune.Decide(1000, 500);
  finetune.Observe(Report(1050, 451));  // above 0.9 * 500
  EXPECT_NEAR(*finetune.ControlsAt(1100).multiplier, 1, 1e-9);
  finetune.Observe(Report(1090, 449));
  EXPECT_NEAR(*finetune.ControlsAt(1110).multiplier, 100, 1e-9);
  EXPECT_EQ(MetricOf(finetune, "finetune/begun_anew"), 1);
  EXPECT_NEAR(*finetune.ControlsAt(1160).multiplier, 10, 1e-9);
  // A report of a policy from before it tells nothing new.
  finetune.Observe(Report(1100, 100));
  EXPECT_NEAR(*finetune.ControlsAt(1160).multiplier, 10, 1e-9);
  EXPECT_EQ(MetricOf(finetune, "finetune/begun_anew"), 1);
}

TEST(Finetune, TheGuardKnowsReturnsBelowZero) {
  Finetune finetune(ConfigOf("RETAIN"));
  finetune.Decide(1000, -100);
  finetune.Observe(Report(1050, -109));
  EXPECT_NEAR(*finetune.ControlsAt(1100).multiplier, 1, 1e-9);
  finetune.Observe(Report(1090, -111));
  EXPECT_NEAR(*finetune.ControlsAt(1110).multiplier, 100, 1e-9);
}

TEST(Finetune, AResumedRunGoesOnInItsPhase) {
  TensorFile offline, online;
  Finetune finetune(ConfigOf("AUTO"));
  finetune.Save(&offline);
  finetune.set_seed_buffer_return(400);
  finetune.Decide(1000, 500);
  finetune.Observe(Report(1090, 100));
  finetune.ControlsAt(1100);
  finetune.Save(&online);

  Finetune in_offline_phase(ConfigOf("AUTO"));
  ASSERT_TRUE(in_offline_phase.Load(offline).ok());
  EXPECT_TRUE(in_offline_phase.IsBetweenPhases(1000));

  Finetune again(ConfigOf("AUTO"));
  again.set_seed_buffer_return(400);
  ASSERT_TRUE(again.Load(online).ok());
  EXPECT_FALSE(again.IsBetweenPhases(1100));
  EXPECT_EQ(again.terms().seed_buffer_share, 0);
  EXPECT_EQ(again.Text(), finetune.Text());
  EXPECT_EQ(*again.ControlsAt(1150).multiplier, *finetune.ControlsAt(1150).multiplier);
  EXPECT_EQ(MetricOf(again, "finetune/begun_anew"), 1);
  again.Observe(Report(1150, 449));  // the offline return is known too
  EXPECT_NEAR(*again.ControlsAt(1160).multiplier, 100, 1e-9);

  EXPECT_TRUE(absl::IsDataLoss(Finetune(ConfigOf("AUTO")).Load(TensorFile())));
}

}  // namespace
}  // namespace dbr
