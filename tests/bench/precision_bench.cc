// How far gradients in bfloat16 are from those in float32 in the course of a training run. Not a matter of
// time: the counters are relative errors, |g16 - g32| / |g32|, over the points of one run.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/rng.h"
#include "envs/registry/registry.h"
#include "learner/algorithms/registry.h"
#include "learner/objectives/sampled_actions.h"
#include "nn/policy.h"
#include "nn/product/product_library.h"

namespace dbr {
namespace {

constexpr int kBatch = 256;
constexpr int kRandomSteps = 1000;
constexpr int kUpdates = 20000;
constexpr int kEvery = 1000;  // updates from one comparison to the next

// Trains SAC in float32 in one process: a step of the environment for each update.
class Training {
 public:
  explicit Training(const std::string& env_name)
      : env_(MakeEnv({.name = env_name, .opponents = {}}).value()) {
    spec_.env = env_name;
    spec_.observation_size = env_->spec().observation_size;
    spec_.actions = env_->spec().actions;
    spec_.hidden_sizes = {256, 256};
    spec_.seed = 1;
    spec_.config.mutable_sac();
    spec_.config.set_threads(1);
    algorithm_ = MakeAlgorithm(spec_).value();
    Publish();
    observation_.resize(spec_.observation_size, 1);
    action_.resize(spec_.actions.size, 1);
    env_->Reset(rng_(), Span(&observation_), {});
    for (int step = 0; step < kRandomSteps; ++step) Step(/*random=*/true);
  }

  void Update() {
    Step(/*random=*/false);
    Draw(&batch_);
    DBR_CHECK(algorithm_->Update({batch_, nothing_, nothing_}).ok());
    if (++updates_ % 50 == 0) Publish();
  }
  // Draws a batch from all steps so far.
  void Draw(Batch* batch) {
    batch->Resize({spec_.observation_size, spec_.actions.width(), 0}, kBatch, /*with_keys=*/false);
    for (int j = 0; j < kBatch; ++j) {
      const Row& row = rows_[rng_.Below(static_cast<std::uint32_t>(rows_.size()))];
      batch->observations.col(j) = row.observation;
      batch->actions.col(j) = row.action;
      batch->next_observations.col(j) = row.next_observation;
      batch->rewards[j] = row.reward;
      batch->discounts[j] = row.discount;
    }
  }
  const AlgorithmSpec& spec() const { return spec_; }
  PolicySnapshot Snapshot() const {
    PolicySnapshot snapshot;
    algorithm_->ExportPolicy(&snapshot);
    return snapshot;
  }

 private:
  struct Row {
    VectorX<float> observation, action, next_observation;
    float reward, discount;
  };

  static absl::Span<float> Span(MatrixX<float>* matrix) {
    return {matrix->data(), static_cast<std::size_t>(matrix->size())};
  }
  void Publish() { policy_ = PolicyNetworks::Create(Snapshot()).value(); }
  void Step(bool random) {
    if (random) {
      action_ = action_.unaryExpr([this](float) { return static_cast<float>(2 * rng_.Uniform() - 1); });
    } else {
      DBR_CHECK(runner_.Act(*policy_, SAMPLE, observation_, MatrixX<float>(0, 1), rng_, action_).ok());
    }
    MatrixX<float> next = observation_;
    const StepResult result = env_->Step(Span(&action_), Span(&next), {});
    rows_.push_back({observation_, action_, next, result.reward, result.terminated ? 0.0f : 0.99f});
    observation_ = next;
    if (result.done()) env_->Reset(rng_(), Span(&observation_), {});
  }

  std::unique_ptr<Env> env_;
  AlgorithmSpec spec_;
  std::unique_ptr<Algorithm> algorithm_;
  Rng rng_{7};
  PolicyRunner runner_;
  std::shared_ptr<const PolicyNetworks> policy_;
  std::vector<Row> rows_;
  MatrixX<float> observation_, action_;
  Batch batch_, nothing_;
  int updates_ = 0;
};

// A network of a snapshot, in both precisions.
class BothPrecisions {
 public:
  BothPrecisions(const MlpShape& shape, const std::vector<float>& parameters)
      : shape_(shape), parameters_(parameters), rounded_(shape) {
    rounded_.RoundAll(shape, parameters.data());
  }
  const MlpShape& shape() const { return shape_; }
  MlpParameters<float> parameters(bool bfloat16) const {
    return {parameters_.data(), bfloat16 ? &rounded_ : nullptr};
  }

 private:
  const MlpShape shape_;
  const std::vector<float> parameters_;
  RoundedWeights rounded_;
};

// The critic's gradient of the mean of (Q(s, a) - y)^2, with y = r + discount * Q(s', a) in float32.
VectorX<float> CriticGradient(const BothPrecisions& critic, const Batch& batch, bool bfloat16) {
  MlpActivations<float> activations;
  MatrixX<float> x(critic.shape().input_size(), batch.size());
  x << batch.next_observations, batch.actions;
  const MatrixX<float> next = MlpForward<float>(critic.shape(), critic.parameters(false), x, &activations);
  const VectorX<float> y = batch.rewards + batch.discounts.cwiseProduct(next.row(0).transpose());
  x << batch.observations, batch.actions;
  const MatrixX<float>& q = MlpForward<float>(critic.shape(), critic.parameters(bfloat16), x, &activations);
  const MatrixX<float> d_q = 2.0f / static_cast<float>(batch.size()) * (q - y.transpose());
  VectorX<float> gradient;
  MlpParameterGradient<float>(critic.parameters(bfloat16), x, d_q, &activations, &gradient);
  return gradient;
}

// The policy's gradient of -E[Q(s, a)], a drawn from it, through the critic.
VectorX<float> PolicyGradient(const BothPrecisions& policy, const BothPrecisions& critic, const Batch& batch,
                              const MatrixX<float>& noise, bool bfloat16) {
  const Eigen::Index n = batch.size();
  MlpActivations<float> of_policy, of_critic;
  GaussianHead<float> head;
  head.Split(MlpForward<float>(policy.shape(), policy.parameters(bfloat16), batch.observations, &of_policy),
             kPolicyLogStd);
  SampledActions<float> draws;
  draws.Draw(head, noise);
  MlpForward<float>(critic.shape(), critic.parameters(bfloat16), draws.CriticInput(batch.observations),
                    &of_critic);
  MatrixX<float> d_action, d_output;
  MlpInputGradient<float>(critic.parameters(bfloat16),
                          MatrixX<float>::Constant(1, n, -1.0f / static_cast<float>(n)), noise.rows(),
                          &of_critic, &d_action);
  GaussianGradient<float> d_head{MatrixX<float>::Zero(noise.rows(), n),
                                 MatrixX<float>::Zero(noise.rows(), n)};
  draws.Backprop(d_action, VectorX<float>::Zero(n), &d_head);
  head.Join(d_head, &d_output);
  VectorX<float> gradient;
  MlpParameterGradient<float>(policy.parameters(bfloat16), batch.observations, d_output, &of_policy,
                              &gradient);
  return gradient;
}

// The mean and the greatest of what was added.
struct Errors {
  double sum = 0, greatest = 0;
  int count = 0;

  void Add(const VectorX<float>& g16, const VectorX<float>& g32) {
    const double error = (g16 - g32).norm() / g32.norm();
    sum += error;
    greatest = std::max(greatest, error);
    ++count;
  }
  double mean() const { return sum / count; }
};

void GradientError(benchmark::State& state, const std::string& env) {
  if (!HasBfloat16()) return state.SkipWithError("the processor has no bfloat16");
  for (auto _ : state) {
    Training training(env);
    Errors of_critic, of_policy;
    Rng rng(3);
    Batch batch;
    MatrixX<float> noise;
    for (int update = 1; update <= kUpdates; ++update) {
      training.Update();
      if (update % kEvery != 0) continue;
      const PolicySnapshot snapshot = training.Snapshot();
      const BothPrecisions policy(PolicyShape(snapshot.spec), *snapshot.Find(kPolicyNetwork));
      const BothPrecisions critic(CriticShape(snapshot.spec), *snapshot.Find(kCritic1));
      training.Draw(&batch);
      FillNormal(rng, training.spec().actions.size, kBatch, &noise);
      of_critic.Add(CriticGradient(critic, batch, true), CriticGradient(critic, batch, false));
      of_policy.Add(PolicyGradient(policy, critic, batch, noise, true),
                    PolicyGradient(policy, critic, batch, noise, false));
    }
    state.counters["critic_mean"] = of_critic.mean();
    state.counters["critic_greatest"] = of_critic.greatest;
    state.counters["policy_mean"] = of_policy.mean();
    state.counters["policy_greatest"] = of_policy.greatest;
  }
}
BENCHMARK_CAPTURE(GradientError, hopper, "hopper")->Iterations(1)->Unit(benchmark::kSecond);
BENCHMARK_CAPTURE(GradientError, half_cheetah, "half_cheetah")->Iterations(1)->Unit(benchmark::kSecond);

}  // namespace
}  // namespace dbr
