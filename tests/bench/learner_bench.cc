// The speed of the algorithms' updates, and of the matrix product that limits them. `flops` is useful
// operations a second.
#include <benchmark/benchmark.h>

#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"

namespace dbr {
namespace {

// Fills a batch with random boards and their legal actions for a discrete space, else with random features
// and actions in the box. A tenth of the transitions have rewards.
void FillBatch(const AlgorithmSpec& spec, int n, Rng& rng, Batch* batch) {
  batch->Resize({spec.observation_size, spec.actions.width(), spec.actions.mask_width()}, n,
                /*with_keys=*/false);
  const bool discrete = spec.actions.discrete();
  const auto feature = [&](float) {
    return discrete ? (rng.Below(4) == 0 ? 1.0f : 0.0f) : static_cast<float>(rng.Normal());
  };
  const auto action = [&](float) {
    return discrete ? static_cast<float>(rng.Below(static_cast<std::uint32_t>(spec.actions.size)))
                    : static_cast<float>(2 * rng.Uniform() - 1);
  };
  batch->observations = batch->observations.unaryExpr(feature);
  batch->next_observations = batch->next_observations.unaryExpr(feature);
  batch->actions = batch->actions.unaryExpr(action);
  batch->masks.setOnes();
  batch->next_masks.setOnes();
  for (int j = 0; j < n; ++j) {
    batch->rewards[j] = rng.Below(10) == 0 ? 1.0f : 0.0f;
    batch->discounts[j] = batch->rewards[j] > 0 ? 0.0f : 0.99f;
  }
}

AlgorithmSpec SpecOf(const char* env, int observation_size, const ActionSpace& actions) {
  AlgorithmSpec spec;
  spec.env = env;
  spec.observation_size = observation_size;
  spec.actions = actions;
  spec.hidden_sizes = {256, 256, 256};
  spec.seed = 1;
  return spec;
}

AlgorithmSpec Connect4() {
  return SpecOf("connect4", 84, {ActionKind::kDiscrete, 7});
}
AlgorithmSpec Hopper() {
  return SpecOf("hopper", 15, {ActionKind::kContinuous, 3});
}
AlgorithmSpec Ant() {
  return SpecOf("ant", 28, {ActionKind::kContinuous, 8});
}

// Makes the algorithm that `set` chooses, on one thread.
template <class Set>
AlgorithmSpec With(AlgorithmSpec spec, const Set& set) {
  set(spec.config);
  spec.config.set_threads(1);
  return spec;
}

void Dbr(AlgorithmConfig& config) {
  config.mutable_dbr()->set_divergence(DbrConfig::MMD_EXACT);
}
// DBR over discrete actions with KL, the default.
void DiscreteDbr(AlgorithmConfig& config) {
  config.mutable_dbr();
}
void Bear(AlgorithmConfig& config) {
  config.mutable_bear()->set_warm_start_updates(0);
}
void Brac(AlgorithmConfig& config) {
  config.mutable_brac();
}
void Sac(AlgorithmConfig& config) {
  config.mutable_sac();
}
void Td3(AlgorithmConfig& config) {
  config.mutable_td3();
}
void Awac(AlgorithmConfig& config) {
  config.mutable_awac();
}
void DiscreteSac(AlgorithmConfig& config) {
  config.mutable_discrete_sac();
}
void Ddqn(AlgorithmConfig& config) {
  config.mutable_ddqn();
}

AlgorithmSpec OnTwoThreads(AlgorithmSpec spec) {
  spec.config.set_threads(2);
  return spec;
}

void LearnerUpdate(benchmark::State& state, const AlgorithmSpec& spec) {
  const auto algorithm = MakeAlgorithm(spec);
  if (!algorithm.ok()) return state.SkipWithError(std::string(algorithm.status().message()).c_str());
  const BatchNeeds needs = (*algorithm)->needs();
  Rng rng(7);
  Batch uniform, plus, minus;
  FillBatch(spec, needs.uniform, rng, &uniform);
  FillBatch(spec, needs.plus, rng, &plus);
  FillBatch(spec, needs.minus, rng, &minus);
  for (auto _ : state) {
    if (const absl::Status status = (*algorithm)->Update({uniform, plus, minus}); !status.ok()) {
      return state.SkipWithError(std::string(status.message()).c_str());
    }
  }
  state.counters["flops"] = benchmark::Counter(
      (*algorithm)->UpdateFlops() * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
  state.SetItemsProcessed(state.iterations());
}
#define DBR_UPDATE(name, spec) \
  BENCHMARK_CAPTURE(LearnerUpdate, , spec)->Name("LearnerUpdate/" name)->Unit(benchmark::kMillisecond)

DBR_UPDATE("dbr/connect4", With(Connect4(), DiscreteDbr));
DBR_UPDATE("bear/connect4", With(Connect4(), Bear));
DBR_UPDATE("discrete_sac/connect4", With(Connect4(), DiscreteSac));
DBR_UPDATE("ddqn/connect4", With(Connect4(), Ddqn));
DBR_UPDATE("sac/hopper", With(Hopper(), Sac));
DBR_UPDATE("dbr/hopper", With(Hopper(), Dbr));
DBR_UPDATE("dbr/ant", With(Ant(), Dbr));
DBR_UPDATE("bear/ant", With(Ant(), Bear));
DBR_UPDATE("brac/ant", With(Ant(), Brac));
DBR_UPDATE("sac/ant", With(Ant(), Sac));
DBR_UPDATE("td3/ant", With(Ant(), Td3));
DBR_UPDATE("awac/ant", With(Ant(), Awac));
// These measure wall-clock time, on one thread and on two.
DBR_UPDATE("sac/ant/one_thread", With(Ant(), Sac))->UseRealTime();
DBR_UPDATE("dbr/ant/one_thread", With(Ant(), Dbr))->UseRealTime();
DBR_UPDATE("sac/ant/two_threads", OnTwoThreads(With(Ant(), Sac)))->UseRealTime();
DBR_UPDATE("dbr/ant/two_threads", OnTwoThreads(With(Ant(), Dbr)))->UseRealTime();
#undef DBR_UPDATE

// The limit: a product of two square matrices in single precision.
void Sgemm(benchmark::State& state) {
  constexpr Eigen::Index kSize = 256;
  const MatrixX<float> a = MatrixX<float>::Random(kSize, kSize), b = MatrixX<float>::Random(kSize, kSize);
  MatrixX<float> c(kSize, kSize);
  for (auto _ : state) {
    c.noalias() = a * b;
    benchmark::DoNotOptimize(c.data());
    benchmark::ClobberMemory();
  }
  state.counters["flops"] = benchmark::Counter(
      2.0 * kSize * kSize * kSize * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(Sgemm)->Name("Sgemm/256x256x256");

}  // namespace
}  // namespace dbr
