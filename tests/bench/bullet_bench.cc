// The speed of the Bullet robots with resets and observations, and of the bare simulation as its limit. Both
// run the same episodes of random actions.
#include <cstdint>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "core/rng.h"
#include "envs/bullet/ant.h"
#include "envs/bullet/half_cheetah.h"
#include "envs/bullet/hopper.h"
#include "envs/bullet/locomotion_task.h"
#include "envs/bullet/walker2d.h"
#include "envs/registry/registry.h"

namespace dbr::bullet {
namespace {

// An episode of random actions. Its random seed is its number.
class Actions {
 public:
  Actions(int width, std::uint64_t episode) : action_(width), rng_(episode) {}
  absl::Span<const float> Draw() {
    for (float& value : action_) value = static_cast<float>(2 * rng_.Uniform() - 1);
    return action_;
  }

 private:
  std::vector<float> action_;
  Rng rng_;
};

// The lengths of a robot's first episodes, some thousand steps together. After the last one the first one
// comes again.
std::vector<int> EpisodeLengths(const std::string& name) {
  constexpr int kSteps = 4000;
  const auto env = MakeEnv({.name = name, .opponents = {}}).value();
  std::vector<float> observation(env->spec().observation_size);
  std::vector<int> lengths;
  for (int steps = 0; steps < kSteps; steps += lengths.back()) {
    const std::uint64_t episode = lengths.size();
    Actions actions(env->spec().actions.width(), episode);
    env->Reset(episode, absl::MakeSpan(observation), {});
    int length = 1;
    while (!env->Step(actions.Draw(), absl::MakeSpan(observation), {}).done()) ++length;
    lengths.push_back(length);
  }
  return lengths;
}

// Items are steps of the environment.
void EnvStep(benchmark::State& state, const std::string& name) {
  const std::uint64_t episodes = EpisodeLengths(name).size();
  const auto env = MakeEnv({.name = name, .opponents = {}}).value();
  std::vector<float> observation(env->spec().observation_size);
  std::uint64_t episode = 0;
  Actions actions(env->spec().actions.width(), episode);
  env->Reset(episode, absl::MakeSpan(observation), {});
  for (auto _ : state) {
    if (!env->Step(actions.Draw(), absl::MakeSpan(observation), {}).done()) continue;
    episode = (episode + 1) % episodes;
    actions = Actions(env->spec().actions.width(), episode);
    env->Reset(episode, absl::MakeSpan(observation), {});
  }
  state.SetItemsProcessed(state.iterations());
}

// Items are steps of the simulation under the same torques; resets are not timed.
void BulletStep(benchmark::State& state, const std::string& name, RobotPlan (*plan)()) {
  const std::vector<int> lengths = EpisodeLengths(name);
  LocomotionTask task(plan());
  std::vector<float> observation(task.observation_size());
  std::uint64_t episode = 0;
  int steps_left = lengths[episode];
  Actions actions(task.num_actions(), episode);
  task.Begin(DrawStart(task.num_actions(), episode), absl::MakeSpan(observation));
  for (auto _ : state) {
    task.Drive(actions.Draw());
    if (--steps_left > 0) continue;
    state.PauseTiming();
    episode = (episode + 1) % lengths.size();
    steps_left = lengths[episode];
    actions = Actions(task.num_actions(), episode);
    task.Begin(DrawStart(task.num_actions(), episode), absl::MakeSpan(observation));
    state.ResumeTiming();
  }
  state.SetItemsProcessed(state.iterations());
}

void Register(const std::string& name, RobotPlan (*plan)()) {
  benchmark::RegisterBenchmark(("EnvStep/" + name).c_str(),
                               [name](benchmark::State& state) { EnvStep(state, name); });
  benchmark::RegisterBenchmark(("BulletStep/" + name).c_str(),
                               [name, plan](benchmark::State& state) { BulletStep(state, name, plan); });
}

[[maybe_unused]] const bool kRegistered = [] {
  Register("hopper", HopperPlan);
  Register("walker2d", Walker2dPlan);
  Register("half_cheetah", HalfCheetahPlan);
  Register("ant", AntPlan);
  return true;
}();

}  // namespace
}  // namespace dbr::bullet
