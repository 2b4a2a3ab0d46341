#include "actor/evaluation_loop.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/monotonic_clock.h"
#include "core/status_macros.h"
#include "envs/registry/registry.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {
namespace {

using PolicyPtr = std::shared_ptr<const PolicyNetworks>;

EvaluationReport ReportOf(const EvaluationResult& result, const PolicySnapshot& snapshot) {
  EvaluationReport report;
  report.set_policy_version(snapshot.version);
  report.set_updates(snapshot.updates);
  report.set_env(result.env);
  report.set_opponent(result.opponent);
  report.set_episodes(result.episodes);
  report.set_score_mean(result.score_mean);
  report.set_score_stderr(result.score_stderr);
  report.set_return_mean(result.return_mean);
  report.set_return_stderr(result.return_stderr);
  return report;
}

void Log(const EvaluationResult& result, const PolicySnapshot& snapshot) {
  if (std::isfinite(result.score_mean)) {
    spdlog::info("policy version {} against {}: score {:.3f} +- {:.3f}, return {:.3f} +- {:.3f}",
                 snapshot.version, result.opponent, result.score_mean, result.score_stderr,
                 result.return_mean, result.return_stderr);
  } else {
    spdlog::info("policy version {} after {} updates: return {:.1f} +- {:.1f} in {:.0f} steps",
                 snapshot.version, snapshot.updates, result.return_mean, result.return_stderr,
                 result.length_mean);
  }
}

}  // namespace

std::vector<std::string> OpponentsToEvaluate(const std::string& env,
                                             const std::vector<std::string>& configured) {
  std::vector<std::string> opponents = configured.empty() ? EvaluationOpponents(env) : configured;
  if (opponents.empty()) opponents.emplace_back();
  return opponents;
}

std::string MeasureOf(const std::string& env, const EvaluationLoopOptions& options) {
  const std::string opponents = absl::StrJoin(options.opponents, ", ");
  return absl::StrCat(env, opponents.empty() ? "" : " against ", opponents, " by ",
                      ActingMode_Name(options.mode));
}

EvaluationLoop::EvaluationLoop(EvaluationLoopOptions options, EvaluationLoopPorts ports)
    : options_(std::move(options)), ports_(std::move(ports)) {
  if (ports_.wait_until) return;
  ports_.wait_until = [this](absl::Time deadline) {
    absl::MutexLock lock(&mutex_);
    AwaitUntil(&mutex_, absl::Condition(&closed_), deadline);
  };
}

void EvaluationLoop::Close() {
  closing_ = true;
  absl::MutexLock lock(&mutex_);
  closed_ = true;
}

absl::Status EvaluationLoop::Run() {
  return options_.every_updates > 0 ? RunByUpdates() : RunByTime();
}

absl::Status EvaluationLoop::RunByTime() {
  absl::Time next = ports_.now();
  while (!closing_) {
    const absl::Status status = EvaluateIfNew();
    if (closing_) break;
    RETURN_IF_ERROR(status);
    SendReports();
    next = std::max(next + options_.every, ports_.now());
    ports_.wait_until(next);
  }
  return absl::OkStatus();
}

absl::Status EvaluationLoop::RunByUpdates() {
  PolicyPtr last;
  while (!closing_) {
    absl::StatusOr<PolicyPtr> policy = ports_.next_policy(last, kSendEvery);
    if (closing_) break;
    if (policy.ok()) {
      last = *std::move(policy);
      const absl::Status status = EvaluateIfDue(last);
      if (closing_) break;
      RETURN_IF_ERROR(status);
    } else if (!absl::IsDeadlineExceeded(policy.status())) {
      return policy.status();
    }
    SendReports();
  }
  return absl::OkStatus();
}

absl::Status EvaluationLoop::EvaluateIfDue(const PolicyPtr& policy) {
  const PolicySnapshot& snapshot = policy->snapshot();
  const std::uint64_t iteration = snapshot.updates / options_.every_updates;
  const bool awaited = snapshot.ends_offline_phase && snapshot.updates != last_updates_;
  if (last_iteration_.has_value() && iteration <= *last_iteration_ && !awaited) return absl::OkStatus();
  last_updates_ = snapshot.updates;
  return EvaluateAll(policy, Reach(iteration));
}

// Moves to a later iteration and logs which ones are skipped.
EvaluationLoop::Iterations EvaluationLoop::Reach(std::uint64_t iteration) {
  Iterations iterations{.current = iteration, .skipped = {}};
  std::uint64_t first = last_iteration_.has_value() ? *last_iteration_ + 1 : options_.resumed ? iteration : 0;
  last_iteration_ = iteration;
  for (; first < iteration; ++first) iterations.skipped.push_back(first);
  if (iterations.skipped.empty()) return iterations;
  skipped_ += iterations.skipped.size();
  spdlog::warn("training is ahead: evaluation iterations {} to {} are skipped, {} so far",
               iterations.skipped.front(), iterations.skipped.back(), skipped_);
  return iterations;
}

absl::Status EvaluationLoop::EvaluateIfNew() {
  ASSIGN_OR_RETURN(PolicyPtr policy, ports_.newest_policy());
  if (policy == nullptr) return absl::OkStatus();
  if (evaluated_ != nullptr && policy->snapshot().version == evaluated_->snapshot().version)
    return absl::OkStatus();
  RETURN_IF_ERROR(EvaluateAll(policy, {}));
  evaluated_ = std::move(policy);
  return absl::OkStatus();
}

// Evaluates the policy against each opponent in turn.
absl::Status EvaluationLoop::EvaluateAll(const PolicyPtr& policy, const Iterations& iterations) {
  const PolicyPtr acting = WithActing(policy, options_.which);
  const PolicySnapshot& snapshot = acting->snapshot();
  double sum = 0;
  for (const std::string& opponent : options_.opponents) {
    const EvaluationOptions evaluation = {.opponent = opponent,
                                          .episodes = options_.episodes,
                                          .seed = options_.seed + snapshot.version,
                                          .mode = options_.mode,
                                          .threads = options_.threads};
    ASSIGN_OR_RETURN(const EvaluationResult result, Evaluate(*acting, evaluation, &closing_));
    Log(result, snapshot);
    sum += std::isfinite(result.score_mean) ? result.score_mean : result.return_mean;
    unsent_.push_back(ReportOf(result, snapshot));
    if (iterations.current.has_value()) unsent_.back().set_iteration(*iterations.current);
    unsent_.back().mutable_skipped_iterations()->Assign(iterations.skipped.begin(), iterations.skipped.end());
    if (unsent_.size() > kMaxUnsent) unsent_.pop_front();
    if (&opponent == &options_.opponents.back() && ports_.on_mean) {
      ports_.on_mean(sum / static_cast<double>(options_.opponents.size()),
                     ServedChoice(policy->snapshot(), options_.which), snapshot);
    }
    SendReports();
  }
  return absl::OkStatus();
}

void EvaluationLoop::SendReports() {
  while (!unsent_.empty()) {
    const absl::Status status = ports_.report(unsent_.front());
    if (!status.ok() && !IsFinal(status)) {
      if (std::exchange(said_loss_, true)) return;
      spdlog::warn("no learner to take an evaluation: {}. Keeping it until there is one",
                   std::string(status.message()));
      return;
    }
    unsent_.pop_front();
    if (std::exchange(said_loss_, false)) spdlog::info("the learner takes evaluations again");
    if (!status.ok()) spdlog::error("the learner refuses an evaluation: {}", std::string(status.message()));
  }
}

}  // namespace dbr
