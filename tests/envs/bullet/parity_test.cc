// Compares the robots with PyBullet: replays recorded episodes from the recorded start with the recorded
// actions.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "envs/bullet/ant.h"
#include "envs/bullet/half_cheetah.h"
#include "envs/bullet/hopper.h"
#include "envs/bullet/locomotion_task.h"
#include "envs/bullet/walker2d.h"
#include "gtest/gtest.h"
#include "tests/support/reference_json.h"

namespace dbr::bullet {
namespace {

using Json = nlohmann::json;

// How closely a replay must agree. On a machine like the recording's it agrees in every bit. On others, sine
// and cosine round differently and contacts amplify that, so only about ten steps can be compared.
struct Agreement {
  int steps = std::numeric_limits<int>::max();
  double difference = 0;  // 0: no difference, not even in the sign of a zero

  bool Holds(double found, double expected) const {
    if (difference == 0) return std::bit_cast<std::uint64_t>(found) == std::bit_cast<std::uint64_t>(expected);
    return std::abs(found - expected) <= difference;
  }
  // Doubles that differ this little may round to neighbouring floats.
  bool HoldsForFloats(float found, float expected) const {
    return Holds(found, expected) || (difference > 0 && std::nextafter(found, expected) == expected);
  }
};

Agreement AgreementOfThisMachine() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("fma")) return {};
#endif
  return {.steps = 10, .difference = 1e-9};
}

void ExpectAgrees(absl::Span<const float> found, const Json& expected, const std::string& what) {
  ASSERT_EQ(found.size(), expected.size()) << what;
  for (std::size_t i = 0; i < found.size(); ++i) {
    ASSERT_PRED2([](float a, float b) { return AgreementOfThisMachine().HoldsForFloats(a, b); }, found[i],
                 expected[i].get<float>())
        << what << "[" << i << "]";
  }
}

void ExpectAgrees(double found, const Json& expected, const std::string& what) {
  ASSERT_PRED2([](double a, double b) { return AgreementOfThisMachine().Holds(a, b); }, found,
               expected.get<double>())
      << what;
}

void ReplayStep(LocomotionTask& task, const Json& steps, int t) {
  const std::string at = " of step " + std::to_string(t);
  std::vector<float> observation(task.observation_size());
  const Progress progress =
      task.Advance(steps["action"][t].get<std::vector<float>>(), absl::MakeSpan(observation));
  ExpectAgrees(observation, steps["obs"][t], "observation" + at);
  for (int i = 0; i < Progress::kTerms; ++i) {
    ExpectAgrees(progress.terms[i], steps["reward_terms"][t][i], "reward term " + std::to_string(i) + at);
  }
  ExpectAgrees(progress.reward, steps["reward"][t], "reward" + at);
  ASSERT_EQ(progress.fallen || !progress.finite, steps["done"][t].get<int>() != 0) << "done" << at;
  ExpectAgrees(task.feet_on_floor(), steps["feet_contact"][t], "feet on the floor" + at);
}

void Replay(LocomotionTask& task, const Json& episode) {
  const Json& reset = episode["reset"];
  std::vector<float> observation(task.observation_size());
  task.Begin({.hinge_angles = reset["joint_pos"].get<std::vector<double>>(),
              .floor_in_mean = !episode["first_reset_of_client"].get<bool>()},
             absl::MakeSpan(observation));
  ExpectAgrees(observation, reset["obs"], "first observation");
  ExpectAgrees(task.potential(), reset["potential"], "first potential");
  const Json& steps = episode["steps"];
  const int count = std::min(AgreementOfThisMachine().steps, static_cast<int>(steps["action"].size()));
  for (int t = 0; t < count && !testing::Test::HasFatalFailure(); ++t) ReplayStep(task, steps, t);
}

struct Robot {
  std::string id;  // PyBullet's name of the environment
  RobotPlan (*plan)();
};

void PrintTo(const Robot& robot, std::ostream* stream) {
  *stream << robot.id;
}

class BulletParity : public testing::TestWithParam<Robot> {};

TEST_P(BulletParity, EveryRecordedEpisodeIsReplayed) {
  int episodes = 0;
  LocomotionTask used(GetParam().plan());
  for (const ReferenceFile& file : ReferenceFiles("pybullet", "")) {
    if (!file.json.contains("episodes") || file.json["env"] != GetParam().id) continue;
    for (const Json& episode : file.json["episodes"]) {
      SCOPED_TRACE(file.name + ", seed " + episode["seed"].dump());
      LocomotionTask fresh(GetParam().plan());
      Replay(episodes % 2 == 0 ? fresh : used, episode);
      ++episodes;
    }
  }
  EXPECT_GT(episodes, 0) << "no recording of " << GetParam().id << " under " << ReferenceDir();
}

const Robot kRobots[] = {{"AntBulletEnv-v0", AntPlan},
                         {"HalfCheetahBulletEnv-v0", HalfCheetahPlan},
                         {"HopperBulletEnv-v0", HopperPlan},
                         {"Walker2DBulletEnv-v0", Walker2dPlan}};

INSTANTIATE_TEST_SUITE_P(Robots, BulletParity, testing::ValuesIn(kRobots),
                         [](const auto& info) { return info.param.id.substr(0, info.param.id.find('B')); });

TEST(BulletParityFiles, AllBelongToARobot) {
  for (const ReferenceFile& file : ReferenceFiles("pybullet", "")) {
    ASSERT_TRUE(file.json.is_object()) << file.name << " is no JSON object";
    if (!file.json.contains("episodes")) continue;
    const bool known = std::any_of(std::begin(kRobots), std::end(kRobots),
                                   [&](const Robot& robot) { return file.json["env"] == robot.id; });
    EXPECT_TRUE(known) << file.name << ": " << file.json["env"];
  }
}

}  // namespace
}  // namespace dbr::bullet
