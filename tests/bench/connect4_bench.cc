// The speed of Connect-4: random games from the empty board to their end, and simulations of the tree search.
#include <cstdint>

#include "benchmark/benchmark.h"
#include "core/rng.h"
#include "envs/connect4/board.h"
#include "envs/connect4/mcts.h"
#include "envs/connect4/playout.h"
#include "envs/env.h"
#include "envs/registry/registry.h"

namespace dbr::connect4 {
namespace {

// Items are games, one at a time, played by the function that the search calls.
void Connect4Playout(benchmark::State& state) {
  Rng rng(1);
  ChoiceStream choices(rng);
  const Board empty;
  int outcomes = 0;
  for (auto _ : state) outcomes += RandomPlayout(empty, choices);
  benchmark::DoNotOptimize(outcomes);
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(Connect4Playout);

// Items are simulations, 100 a move, from an early position. No such search proves it and stops before its
// last simulation.
void MctsSimulations(benchmark::State& state) {
  constexpr int kSimulations = 100;
  Rng rng(1);
  TreeSearch search(kSimulations);
  const Board opening = Board::FromMoves("44").value();
  for (auto _ : state) benchmark::DoNotOptimize(search.ChooseColumn(opening, rng));
  state.SetItemsProcessed(state.iterations() * kSimulations);
}
BENCHMARK(MctsSimulations);

// Items are steps of the environment, with the reply of a random opponent and both observations.
void Connect4EnvStep(benchmark::State& state) {
  const auto env = MakeEnv({.name = "connect4", .opponents = {}}).value();
  float observation[kObservationSize];
  float mask[kColumns];
  std::uint64_t seed = 0;
  env->Reset(seed, absl::MakeSpan(observation), absl::MakeSpan(mask));
  for (auto _ : state) {
    float column = 0;
    while (mask[static_cast<int>(column)] == 0) ++column;
    const StepResult result =
        env->Step(absl::MakeConstSpan(&column, 1), absl::MakeSpan(observation), absl::MakeSpan(mask));
    if (result.done()) env->Reset(++seed, absl::MakeSpan(observation), absl::MakeSpan(mask));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(Connect4EnvStep);

}  // namespace
}  // namespace dbr::connect4
