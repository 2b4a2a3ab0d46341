// Updates of the algorithms beside the matrix product that limits them; `flops` is useful operations a
// second.
#include <benchmark/benchmark.h>

#include "core/rng.h"
#include "learner/algorithm.h"
#include "nn/blas_threads.h"

namespace dbr {
namespace {

// A batch of random boards with their legal actions; rewards at a tenth of the transitions.
void FillBatch(const AlgorithmSpec& spec, int n, Rng& rng, Batch* batch) {
  batch->Resize({spec.observation_size, spec.actions.width(), spec.actions.mask_width()}, n,
                /*with_keys=*/false);
  const auto bit = [&](float) { return rng.Below(4) == 0 ? 1.0f : 0.0f; };
  batch->observations = batch->observations.unaryExpr(bit);
  batch->next_observations = batch->next_observations.unaryExpr(bit);
  batch->masks.setOnes();
  batch->next_masks.setOnes();
  for (int j = 0; j < n; ++j) {
    batch->actions(0, j) = static_cast<float>(rng.Below(static_cast<std::uint32_t>(spec.actions.size)));
    batch->rewards[j] = rng.Below(10) == 0 ? 1.0f : 0.0f;
    batch->discounts[j] = batch->rewards[j] > 0 ? 0.0f : 0.99f;
  }
}

AlgorithmSpec Connect4Spec() {
  AlgorithmSpec spec;
  spec.env = "connect4";
  spec.observation_size = 84;
  spec.actions = {ActionKind::kDiscrete, 7};
  spec.hidden_sizes = {256, 256, 256};
  spec.config.mutable_dbr();
  spec.seed = 1;
  return spec;
}

void LearnerUpdate(benchmark::State& state, const AlgorithmSpec& spec) {
  UseOneBlasThread();
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
BENCHMARK_CAPTURE(LearnerUpdate, dbr_connect4, Connect4Spec())
    ->Name("LearnerUpdate/dbr/connect4")
    ->Unit(benchmark::kMillisecond);

// The limit: a product of two square matrices in single precision.
void Sgemm(benchmark::State& state) {
  UseOneBlasThread();
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
