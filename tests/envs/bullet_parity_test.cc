// The robots beside PyBullet: recorded episodes, replayed from the recorded start with the recorded actions.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "envs/bullet/ant.h"
#include "envs/bullet/half_cheetah.h"
#include "envs/bullet/hopper.h"
#include "envs/bullet/locomotion_task.h"
#include "envs/bullet/multibody.h"
#include "envs/bullet/walker2d.h"
#include "gtest/gtest.h"
#include "tests/reference_json.h"

namespace dbr::bullet {
namespace {

using Json = nlohmann::json;

RobotPlan PlanOf(const std::string& env) {
  if (env == "AntBulletEnv-v0") return AntPlan();
  if (env == "HalfCheetahBulletEnv-v0") return HalfCheetahPlan();
  if (env == "HopperBulletEnv-v0") return HopperPlan();
  if (env == "Walker2DBulletEnv-v0") return Walker2dPlan();
  return {};
}

// Bit for bit where the machine has what the recording's had; else the contacts, which amplify every
// rounding, leave some ten steps to compare.
struct Tolerance {
  int steps;
  double difference;
};
Tolerance OfThisMachine() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("fma")) return {1 << 30, 0};
#endif
  return {10, 1e-9};
}

void ExpectClose(const std::vector<float>& found, const Json& expected, double tolerance,
                 const std::string& what) {
  ASSERT_EQ(found.size(), expected.size()) << what;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double value = expected[i].get<double>();
    ASSERT_LE(std::abs(found[i] - static_cast<float>(value)), tolerance) << what << " " << i;
  }
}

void Replay(LocomotionTask& task, const Json& episode) {
  const Tolerance tolerance = OfThisMachine();
  std::vector<float> observation(task.observation_size());
  const Json& reset = episode["reset"];
  task.Begin({.hinge_angles = reset["joint_pos"].get<std::vector<double>>(),
              .floor_in_mean = !episode["first_reset_of_client"].get<bool>()},
             absl::MakeSpan(observation));
  ExpectClose(observation, reset["obs"], tolerance.difference, "first observation");
  EXPECT_NEAR(task.potential(), reset["potential"].get<double>(), tolerance.difference);
  const Json& steps = episode["steps"];
  const int count = std::min<int>(tolerance.steps, static_cast<int>(steps["action"].size()));
  for (int t = 0; t < count; ++t) {
    const std::string at = "step " + std::to_string(t);
    const Progress progress =
        task.Advance(steps["action"][t].get<std::vector<float>>(), absl::MakeSpan(observation));
    ExpectClose(observation, steps["obs"][t], tolerance.difference, at + " observation");
    if (testing::Test::HasFatalFailure()) return;
    for (int i = 0; i < Progress::kTerms; ++i) {
      ASSERT_NEAR(progress.terms[i], steps["reward_terms"][t][i].get<double>(), tolerance.difference)
          << at << i;
    }
    ASSERT_NEAR(progress.reward, steps["reward"][t].get<double>(), tolerance.difference) << at;
    ASSERT_EQ(progress.fallen || !progress.finite, steps["done"][t].get<int>() != 0) << at;
    for (std::size_t foot = 0; foot < task.feet_on_floor().size(); ++foot) {
      ASSERT_EQ(task.feet_on_floor()[foot], steps["feet_contact"][t][foot].get<float>()) << at;
    }
  }
}

TEST(BulletParity, EveryRecordedEpisodeIsReplayed) {
  for (const ReferenceFile& file : ReferenceFiles("pybullet", "")) {
    if (!file.json.contains("episodes")) continue;
    const RobotPlan plan = PlanOf(file.json["env"].get<std::string>());
    if (plan.body.parts.empty()) continue;
    LocomotionTask task(plan);
    for (const Json& episode : file.json["episodes"]) {
      SCOPED_TRACE(file.name + ", seed " + episode["seed"].dump());
      Replay(task, episode);
    }
  }
}

}  // namespace
}  // namespace dbr::bullet
