// The speed of the algorithms' updates, and of the matrix product that limits them. `flops` is useful
// operations a second.
#include <benchmark/benchmark.h>

#include <string>
#include <type_traits>

#include "core/rng.h"
#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"
#include "nn/product/layer_products.h"
#include "nn/product/product_library.h"

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
// DBR as deploy/configs has it for the robots online.
void DbrOfTheConfigs(AlgorithmConfig& config) {
  DbrConfig& dbr = *config.mutable_dbr();
  dbr.set_constraint(DbrConfig::DYNAMIC_MAX);
  dbr.set_divergence(DbrConfig::KL);
  dbr.set_epsilon(0.1);
  dbr.set_repel_negative(true);
  dbr.set_first_temperature(1);
  dbr.set_behavior_batch_size(128);
  dbr.set_target_min_weight(1);
  dbr.set_target_samples(1);
  dbr.set_policy_samples(1);
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

AlgorithmSpec InBfloat16(AlgorithmSpec spec) {
  spec.bfloat16 = true;
  return spec;
}

AlgorithmSpec WithLayerNorm(AlgorithmSpec spec) {
  spec.critic_layer_norm = true;
  return spec;
}

// Each update in single precision and, where the processor has it, in bfloat16.
void Register(const std::string& name, const AlgorithmSpec& spec, bool real_time) {
  const auto add = [&](const std::string& full_name, const AlgorithmSpec& of) {
    benchmark::internal::Benchmark* const added = benchmark::RegisterBenchmark(
        full_name.c_str(), [of](benchmark::State& state) { LearnerUpdate(state, of); });
    added->Unit(benchmark::kMillisecond);
    if (real_time) added->UseRealTime();
  };
  add("LearnerUpdate/" + name + "/f32", spec);
  if (HasBfloat16()) add("LearnerUpdate/" + name + "/bf16", InBfloat16(spec));
}

const bool kUpdatesRegistered = [] {
  const auto add = [](const char* name, const AlgorithmSpec& env, auto algorithm) {
    Register(name, With(env, algorithm), /*real_time=*/false);
  };
  add("dbr/connect4", Connect4(), DiscreteDbr);
  add("bear/connect4", Connect4(), Bear);
  add("discrete_sac/connect4", Connect4(), DiscreteSac);
  add("ddqn/connect4", Connect4(), Ddqn);
  add("sac/hopper", Hopper(), Sac);
  add("sac_layer_norm/hopper", WithLayerNorm(Hopper()), Sac);
  add("dbr/hopper", Hopper(), Dbr);
  add("dbr_layer_norm/hopper", WithLayerNorm(Hopper()), Dbr);
  add("dbr_of_the_configs/hopper", Hopper(), DbrOfTheConfigs);
  add("dbr/ant", Ant(), Dbr);
  add("bear/ant", Ant(), Bear);
  add("brac/ant", Ant(), Brac);
  add("sac/ant", Ant(), Sac);
  add("td3/ant", Ant(), Td3);
  add("awac/ant", Ant(), Awac);
  // These measure wall-clock time, on one thread and on two.
  const AlgorithmSpec sac = With(Ant(), Sac), dbr = With(Ant(), Dbr);
  Register("sac/ant/one_thread", sac, /*real_time=*/true);
  Register("dbr/ant/one_thread", dbr, /*real_time=*/true);
  Register("sac/ant/two_threads", OnTwoThreads(sac), /*real_time=*/true);
  Register("dbr/ant/two_threads", OnTwoThreads(dbr), /*real_time=*/true);
  return true;
}();

// The limits: a product of two square matrices, by OpenBLAS, and as a layer's product by what the networks
// use.
constexpr Eigen::Index kSize = 256;

void SetProductFlops(benchmark::State& state) {
  state.counters["flops"] = benchmark::Counter(
      2.0 * kSize * kSize * kSize * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

void Sgemm(benchmark::State& state) {
  const MatrixX<float> a = MatrixX<float>::Random(kSize, kSize), b = MatrixX<float>::Random(kSize, kSize);
  MatrixX<float> c(kSize, kSize);
  for (auto _ : state) {
    c.noalias() = a * b;
    benchmark::DoNotOptimize(c.data());
    benchmark::ClobberMemory();
  }
  SetProductFlops(state);
}
BENCHMARK(Sgemm)->Name("Sgemm/256x256x256");

template <class Element>
void LayerProduct(benchmark::State& state) {
  if (std::is_same_v<Element, Bfloat16> && !HasBfloat16()) {
    return state.SkipWithError("the processor has no bfloat16");
  }
  const MatrixX<Element> weight = MatrixX<float>::Random(kSize, kSize).cast<Element>(),
                         x = MatrixX<float>::Random(kSize, kSize).cast<Element>();
  const VectorX<float> bias = VectorX<float>::Random(kSize);
  MatrixX<Element> y(kSize, kSize);
  const auto products = MakeLayerProducts<Element>({kSize, kSize});
  for (auto _ : state) {
    products->Hidden({weight.data(), kSize, bias.data()}, {x.data(), kSize, kSize, kSize},
                     {y.data(), kSize, kSize, kSize});
    benchmark::DoNotOptimize(y.data());
    benchmark::ClobberMemory();
  }
  state.SetLabel(KernelsName(std::is_same_v<Element, Bfloat16>));
  SetProductFlops(state);
}
BENCHMARK(LayerProduct<float>)->Name("Product/f32");
BENCHMARK(LayerProduct<Bfloat16>)->Name("Product/bf16");

}  // namespace
}  // namespace dbr
