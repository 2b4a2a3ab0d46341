// The speed of acting: the agent's moves a second on one core, with everything that an actor does except the
// network transfer.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "actor/evaluator.h"
#include "actor/step_loop.h"
#include "benchmark/benchmark.h"
#include "core/check.h"
#include "nn/mlp.h"
#include "nn/policy.h"
#include "proto/rpc/codec.h"

namespace dbr {
namespace {

constexpr int kGames = 256;
constexpr int kBatchBytes = 32 << 10;  // bytes of an insert message, as the config's default

// An untrained policy with twin critics of the paper's size.
std::shared_ptr<const PolicyNetworks> UntrainedPolicy(const EnvSpec& env) {
  PolicySnapshot snapshot;
  snapshot.version = 1;
  snapshot.spec = {.env = env.name,
                   .algorithm = "dbr",
                   .observation_size = env.observation_size,
                   .actions = env.actions,
                   .hidden_sizes = {256, 256, 256}};
  const MlpShape shape(env.observation_size, snapshot.spec.hidden_sizes, env.actions.size);
  Rng rng(1);
  for (const char* name : {kPolicyNetwork, kCritic1, kCritic2}) {
    const VectorX<float> parameters = InitialParameters<float>(shape, rng);
    snapshot.networks.emplace_back(name, std::vector<float>(parameters.begin(), parameters.end()));
  }
  return PolicyNetworks::Create(std::move(snapshot)).value();
}

double FlopsOfAMove(const EnvSpec& env) {
  return 3 * MlpShape(env.observation_size, {256, 256, 256}, env.actions.size).ForwardFlops(1);
}

// Items are the agent's moves against the random opponent: the forward passes of the policy and both critics,
// the first advantage, the games, and the encoding of the transitions as an insert message holds them.
// `flops` counts only the matrix products.
void ActorMoves(benchmark::State& state, const std::string& env_name) {
  auto envs = VectorEnv::Create({.name = env_name, .opponents = {}}, kGames).value();
  const EnvSpec spec = envs->spec();
  const TransitionLayout layout = TransitionLayout::Of(spec);
  const auto batch_size = static_cast<std::uint32_t>(kBatchBytes / (layout.stride() * sizeof(float)));
  const auto policy = UntrainedPolicy(spec);
  TransitionBatch batch;
  SetLayout(layout, &batch);
  StepLoop loop(std::move(envs), StepLoopOptions(), Rng(1),
                [&](const TransitionView& transition, float advantage, std::uint64_t critic_version,
                    const std::optional<EpisodeEnd>& end) {
                  if (batch.count() == batch_size) {
                    batch.Clear();
                    SetLayout(layout, &batch);
                  }
                  AppendTransition(transition, advantage, critic_version, &batch);
                  benchmark::DoNotOptimize(end.has_value());
                  return absl::OkStatus();
                });
  for (auto _ : state) DBR_CHECK(loop.Step(*policy).ok());
  state.SetItemsProcessed(state.iterations() * kGames);
  state.counters["flops"] =
      benchmark::Counter(FlopsOfAMove(spec) * kGames * state.iterations(), benchmark::Counter::kIsRate);
}
BENCHMARK_CAPTURE(ActorMoves, connect4, "connect4")->Unit(benchmark::kMicrosecond);

// Items are episodes of the evaluator on one thread.
void EvaluatedEpisodes(benchmark::State& state, const std::string& env_name, const std::string& opponent) {
  const auto envs = VectorEnv::Create({.name = env_name, .opponents = {}}, 1).value();
  const auto policy = UntrainedPolicy(envs->spec());
  const EvaluationOptions options = {
      .opponent = opponent, .episodes = 256, .seed = 1, .mode = MODE, .threads = 1};
  for (auto _ : state) DBR_CHECK(Evaluate(*policy, options).ok());
  state.SetItemsProcessed(state.iterations() * options.episodes);
}
BENCHMARK_CAPTURE(EvaluatedEpisodes, connect4_random, "connect4", "random")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(EvaluatedEpisodes, connect4_mcts_100, "connect4", "mcts:100")
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dbr
