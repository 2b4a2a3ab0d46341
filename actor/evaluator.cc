#include "actor/evaluator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "actor/policy_fit.h"
#include "actor/vector_env.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "envs/registry/registry.h"

namespace dbr {
namespace {

// Plays the groups of one evaluation; each thread takes the next group that nobody has taken.
class GroupPlayer {
 public:
  GroupPlayer(const PolicyNetworks& policy, const EvaluationOptions& options,
              const std::atomic<bool>* cancelled)
      : policy_(policy),
        options_(options),
        cancelled_(cancelled),
        returns_(options.episodes, 0.0),
        lengths_(options.episodes, 0.0),
        scores_(options.episodes, std::numeric_limits<double>::quiet_NaN()) {}

  int group_count() const { return (options_.episodes + kEvaluationColumns - 1) / kEvaluationColumns; }

  // Runs in each thread. The first error ends all of them.
  void PlayGroups() {
    const absl::Status status = TryPlayGroups();
    if (status.ok()) return;
    failed_ = true;
    absl::MutexLock lock(&mutex_);
    status_.Update(status);
  }

  // After all threads have ended.
  absl::StatusOr<EvaluationResult> Result() const {
    {
      absl::MutexLock lock(&mutex_);
      if (!status_.ok()) return status_;
    }
    const MeanEstimate score = EstimateMean(scores_), episode_return = EstimateMean(returns_);
    return EvaluationResult{.env = policy_.spec().env,
                            .opponent = options_.opponent,
                            .episodes = options_.episodes,
                            .seed = options_.seed,
                            .score_mean = score.mean,
                            .score_stderr = score.standard_error,
                            .return_mean = episode_return.mean,
                            .return_stderr = episode_return.standard_error,
                            .return_std = episode_return.standard_error * std::sqrt(options_.episodes),
                            .return_min = *std::min_element(returns_.begin(), returns_.end()),
                            .return_max = *std::max_element(returns_.begin(), returns_.end()),
                            .length_mean = EstimateMean(lengths_).mean};
  }

 private:
  absl::Status TryPlayGroups() {
    EnvOptions env_options{.name = policy_.spec().env, .opponents = {}};
    if (!options_.opponent.empty()) env_options.opponents.push_back(options_.opponent);
    ASSIGN_OR_RETURN(const std::unique_ptr<VectorEnv> envs,
                     VectorEnv::Create(env_options, kEvaluationColumns));
    RETURN_IF_ERROR(CheckPolicyFits(policy_.spec(), envs->spec()));
    PolicyRunner runner;
    for (int group = next_group_++; group < group_count(); group = next_group_++) {
      RETURN_IF_ERROR(PlayGroup(group, envs.get(), &runner));
    }
    return absl::OkStatus();
  }

  absl::Status PlayGroup(int group, VectorEnv* envs, PolicyRunner* runner) {
    const int first = group * kEvaluationColumns;
    const int count = std::min(kEvaluationColumns, options_.episodes - first);
    for (int i = 0; i < count; ++i) envs->Reset(i, options_.seed * kMaxEpisodes + first + i);
    Rng rng = Rng(options_.seed).Fork(group);
    MatrixX<float> actions = MatrixX<float>::Zero(envs->spec().actions.width(), envs->size());
    std::vector<bool> playing(count, true);
    for (int left = count; left > 0;) {
      if (failed_) return absl::OkStatus();
      if (cancelled_ != nullptr && *cancelled_) return absl::CancelledError("the evaluation was stopped");
      RETURN_IF_ERROR(runner->Act(policy_, options_.mode, envs->observations(), envs->masks(), rng, actions));
      for (int i = 0; i < count; ++i) {
        if (!playing[i]) continue;
        const StepResult& result = envs->Step(i, actions);
        returns_[first + i] += result.reward;
        lengths_[first + i] += 1;
        if (!result.done()) continue;
        if (envs->spec().has_score) scores_[first + i] = result.score;
        playing[i] = false;
        --left;
      }
      envs->Advance();
    }
    return absl::OkStatus();
  }

  const PolicyNetworks& policy_;
  const EvaluationOptions& options_;
  const std::atomic<bool>* const cancelled_;
  std::atomic<int> next_group_ = 0;
  std::atomic<bool> failed_ = false;
  std::vector<double> returns_;  // [episodes]; each entry belongs to the thread that plays it
  std::vector<double> lengths_;  // [episodes]
  std::vector<double> scores_;   // [episodes]
  mutable absl::Mutex mutex_;
  absl::Status status_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

MeanEstimate EstimateMean(absl::Span<const double> values) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<double>(values.size());
  if (values.empty()) return {kNaN, kNaN};
  double sum = 0, squares = 0;
  for (const double value : values) sum += value;
  const double mean = sum / n;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return {mean, values.size() > 1 ? std::sqrt(squares / (n - 1) / n) : kNaN};
}

absl::StatusOr<EvaluationResult> Evaluate(const PolicyNetworks& policy, const EvaluationOptions& options,
                                          const std::atomic<bool>* cancelled) {
  if (options.episodes < 1 || options.episodes > kMaxEpisodes) {
    return absl::InvalidArgumentError(
        absl::StrCat("episodes: expected 1 to ", kMaxEpisodes, ", found ", options.episodes));
  }
  GroupPlayer player(policy, options, cancelled);
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int threads = std::min(options.threads > 0 ? options.threads : cores, player.group_count());
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back([&player] { player.PlayGroups(); });
  player.PlayGroups();
  for (std::thread& thread : others) thread.join();
  return player.Result();
}

absl::StatusOr<std::vector<EvaluationResult>> EvaluateAgainst(const PolicyNetworks& policy,
                                                              const std::vector<std::string>& opponents,
                                                              EvaluationOptions options,
                                                              const std::atomic<bool>* cancelled) {
  std::vector<EvaluationResult> results;
  for (const std::string& opponent : opponents) {
    options.opponent = opponent;
    ASSIGN_OR_RETURN(results.emplace_back(), Evaluate(policy, options, cancelled));
  }
  return results;
}

}  // namespace dbr
