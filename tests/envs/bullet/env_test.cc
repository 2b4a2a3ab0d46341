// Tests the robots as environments: what an episode is, what ends it, and what happens to a world that
// breaks.
#include "envs/env.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/rng.h"
#include "envs/bullet/hopper.h"
#include "envs/bullet/locomotion.h"
#include "envs/registry/registry.h"
#include "gtest/gtest.h"

namespace dbr {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
const char* const kRobots[] = {"ant", "half_cheetah", "hopper", "walker2d"};

std::unique_ptr<Env> Make(const std::string& name) {
  return MakeEnv({.name = name, .opponents = {}}).value();
}

// An environment with memory for its observation.
struct World {
  explicit World(const std::string& name) : env(Make(name)), observation(env->spec().observation_size) {}

  void Reset(std::uint64_t seed) { env->Reset(seed, absl::MakeSpan(observation), {}); }
  StepResult Step(const std::vector<float>& action) {
    return env->Step(action, absl::MakeSpan(observation), {});
  }
  StepResult StepAllAt(float value) { return Step(std::vector<float>(env->spec().actions.size, value)); }

  std::unique_ptr<Env> env;
  std::vector<float> observation;
};

// Returns all observations and rewards of `steps` steps of random actions, over as many episodes as that
// takes.
std::vector<float> Wander(const std::string& name, std::uint64_t seed, int steps) {
  World world(name);
  Rng rng(seed);
  std::vector<float> seen;
  std::vector<float> action(world.env->spec().actions.size);
  bool done = true;
  for (int t = 0; t < steps; ++t) {
    if (done) world.Reset(seed++);
    for (float& value : action) value = static_cast<float>(2 * rng.Uniform() - 1);
    const StepResult result = world.Step(action);
    done = result.done();
    seen.insert(seen.end(), world.observation.begin(), world.observation.end());
    seen.push_back(result.reward);
  }
  return seen;
}

TEST(BulletEnv, SpecsAreThoseOfPyBullet) {
  const struct {
    std::string name, id;
    int observation_size, actions;
  } expected[] = {{"ant", "AntBulletEnv-v0", 28, 8},
                  {"half_cheetah", "HalfCheetahBulletEnv-v0", 26, 6},
                  {"hopper", "HopperBulletEnv-v0", 15, 3},
                  {"walker2d", "Walker2DBulletEnv-v0", 22, 6}};
  for (const auto& robot : expected) {
    const EnvSpec spec = Make(robot.name)->spec();
    EXPECT_EQ(spec.observation_size, robot.observation_size) << robot.name;
    EXPECT_EQ(spec.actions, (ActionSpace{ActionKind::kContinuous, robot.actions})) << robot.name;
    EXPECT_EQ(spec.max_episode_steps, 1000) << robot.name;
    EXPECT_EQ(Make(robot.id)->spec(), spec) << robot.id;
  }
}

TEST(BulletEnv, StartsDifferWithTheSeedAndStayWithinATenthOfARadian) {
  World world("hopper");
  world.Reset(1);
  const std::vector<float> first = world.observation;
  world.Reset(2);
  EXPECT_NE(world.observation, first);
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (const double angle : bullet::DrawStart(3, seed).hinge_angles) EXPECT_LE(std::abs(angle), 0.1);
  }
}

TEST(BulletEnv, AFallIsATerminalAndNoTruncation) {
  for (const char* const name : {"ant", "hopper", "walker2d"}) {
    World world(name);
    world.Reset(2);
    StepResult result;
    int steps = 0;
    for (; !result.done(); ++steps) result = world.StepAllAt(0);
    EXPECT_LT(steps, 100) << name << " stands without an effort";
    EXPECT_TRUE(result.terminated && !result.truncated && !result.broken) << name;
  }
}

TEST(BulletEnv, TheTimeLimitIsATruncationAndNoTerminal) {
  World world("half_cheetah");
  world.Reset(1);
  for (int t = 1; t < 1000; ++t) ASSERT_FALSE(world.StepAllAt(0.1f).done()) << t;
  const StepResult last = world.StepAllAt(0.1f);
  EXPECT_TRUE(last.truncated);
  EXPECT_FALSE(last.terminated);
  EXPECT_FALSE(last.broken);
}

TEST(BulletEnv, AnActionBeyondOneMovesNoMoreButCostsMore) {
  for (const char* const name : kRobots) {
    World within(name), beyond(name);
    within.Reset(3);
    beyond.Reset(3);
    const float reward_within = within.StepAllAt(1.0f).reward;
    const float reward_beyond = beyond.StepAllAt(1.5f).reward;
    EXPECT_EQ(within.observation, beyond.observation) << name;
    EXPECT_LT(reward_beyond, reward_within) << name;
  }
}

TEST(BulletEnv, AWorldThatBreaksCutsTheEpisodeAtItsLastSoundObservation) {
  for (const char* const name : kRobots) {
    World world(name), untouched(name);
    world.Reset(4);
    world.StepAllAt(0.5f);
    const std::vector<float> last = world.observation;
    const StepResult result = world.StepAllAt(kNaN);
    EXPECT_TRUE(result.broken && result.truncated && !result.terminated) << name;
    EXPECT_EQ(result.reward, 0.0f) << name;
    EXPECT_EQ(world.observation, last) << name;

    world.Reset(5);
    untouched.Reset(5);
    for (int t = 0; t < 3; ++t) {
      EXPECT_EQ(world.StepAllAt(0.3f).reward, untouched.StepAllAt(0.3f).reward) << name;
      EXPECT_EQ(world.observation, untouched.observation) << name;
    }
  }
}

TEST(BulletEnv, ACostTooLargeForAFloatBreaksTheEpisode) {
  World world("hopper");
  world.Reset(6);
  EXPECT_TRUE(world.StepAllAt(1e30f).broken);
}

TEST(BulletTask, APhysicsStateThatIsNotFiniteIsSeen) {
  bullet::LocomotionTask task(bullet::HopperPlan());
  std::vector<float> observation(task.observation_size());
  task.Begin({.hinge_angles = {0, std::numeric_limits<double>::quiet_NaN(), 0}}, absl::MakeSpan(observation));
  EXPECT_FALSE(task.Advance(std::vector<float>(3, 0.0f), absl::MakeSpan(observation)).finite);
}

TEST(BulletEnv, WorldsOnSeveralThreadsDoNotTouchEachOther) {
  constexpr int kThreads = 4;
  constexpr int kSteps = 150;
  for (const char* const name : kRobots) {
    std::vector<std::vector<float>> seen(kThreads);
    std::vector<std::thread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&, i] { seen[i] = Wander(name, 10 * static_cast<std::uint64_t>(i), kSteps); });
    }
    for (std::thread& thread : threads) thread.join();
    for (int i = 0; i < kThreads; ++i) {
      EXPECT_EQ(seen[i], Wander(name, 10 * static_cast<std::uint64_t>(i), kSteps)) << name;
    }
  }
}

}  // namespace
}  // namespace dbr
