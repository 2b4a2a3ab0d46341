// Bullet robots: a step of the environment with random actions, resets included, beside the bare simulation of the
// same world under the same torques.
#include <benchmark/benchmark.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "core/rng.h"
#include "envs/env.h"

namespace dbr {
namespace {

void EnvStep(benchmark::State& state, const std::string& name) {
  const std::unique_ptr<Env> env = MakeEnv({.name = name, .opponents = {}}).value();
  std::vector<float> observation(env->spec().observation_size);
  std::vector<float> action(env->spec().actions.width());
  Rng rng(1);
  std::uint64_t episode = 0;
  env->Reset(episode, absl::MakeSpan(observation), {});
  for (auto _ : state) {
    for (float& value : action) value = static_cast<float>(2 * rng.Uniform() - 1);
    if (env->Step(action, absl::MakeSpan(observation), {}).done()) {
      env->Reset(++episode, absl::MakeSpan(observation), {});
    }
  }
  state.SetItemsProcessed(state.iterations());
}

[[maybe_unused]] const bool kRegistered = [] {
  for (const char* name : {"hopper", "walker2d", "half_cheetah", "ant"}) {
    benchmark::RegisterBenchmark((std::string("EnvStep/") + name).c_str(),
                                 [name = std::string(name)](benchmark::State& state) { EnvStep(state, name); });
  }
  return true;
}();

}  // namespace
}  // namespace dbr
