#include "learner/runtime/finetune.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "learner/training/tensor_state.h"

namespace dbr {
namespace {

constexpr char kReturn[] = "finetune.offline_return", kMode[] = "finetune.mode", kBegun[] = "finetune.begun",
               kBegunAnew[] = "finetune.begun_anew";

}  // namespace

Finetune::Finetune(const Config& config)
    : config_(config.finetune()), offline_updates_(config.learner().offline_updates()) {}

void Finetune::Observe(const EvaluationReport& report) {
  if (!designed()) return;
  absl::MutexLock lock(&mutex_);
  newest_ = report;
}

void Finetune::Close() {
  absl::MutexLock lock(&mutex_);
  closed_ = true;
}

std::optional<double> Finetune::AwaitOfflineReturn(std::uint64_t updates) {
  const auto ready = [this, updates]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return closed_ || (newest_.has_value() && newest_->updates() == updates);
  };
  absl::MutexLock lock(&mutex_);
  mutex_.Await(absl::Condition(&ready));
  if (closed_) return std::nullopt;
  const double offline_return = newest_->return_mean();
  newest_.reset();
  return offline_return;
}

void Finetune::Decide(std::uint64_t updates, double offline_return) {
  offline_return_ = offline_return;
  decided_ = config_.mode();
  if (config_.mode() == FinetuneConfig::AUTO) {
    const bool as_good = offline_return >= config_.auto_share() * seed_buffer_return_;  // false for NaN
    decided_ = as_good ? FinetuneConfig::WARM_START : FinetuneConfig::RETAIN;
  }
  begun_ = updates;
}

std::string Finetune::Text() const {
  if (!decided_.has_value()) return "";
  const std::string returns =
      absl::StrFormat("the offline policy has a mean return of %.1f", offline_return_);
  const std::string of_seed = std::isfinite(seed_buffer_return_)
                                  ? absl::StrFormat(", the seed buffer %.1f", seed_buffer_return_)
                                  : std::string(", the seed buffer has no whole episode");
  const std::string way = *decided_ == FinetuneConfig::RETAIN
                              ? absl::StrFormat("RETAIN, the seed buffer keeps %.0f%% of each draw",
                                                100 * config_.retained_share())
                              : std::string("WARM_START, the seed buffer is left behind");
  return absl::StrCat("fine-tuning: ", returns, of_seed, ": ", way, "; the next update comes after ",
                      config_.first_transitions(), " transitions");
}

DrawTerms Finetune::terms() const {
  if (!decided_.has_value()) return {};
  const bool retains = *decided_ == FinetuneConfig::RETAIN;
  return {.seed_buffer_share = retains ? config_.retained_share() : 0,
          .first_transitions = config_.first_transitions()};
}

double Finetune::GuardedReturn() const {
  return offline_return_ - (1 - config_.guard_share()) * std::abs(offline_return_);
}

UpdateControls Finetune::ControlsAt(std::uint64_t updates) {
  if (!designed()) return {};
  updates_ = updates;
  std::optional<EvaluationReport> report;
  {
    absl::MutexLock lock(&mutex_);
    report.swap(newest_);
  }
  if (decided_.has_value() && config_.guard_share() > 0 && report.has_value() && report->updates() > begun_ &&
      report->return_mean() < GuardedReturn()) {
    begun_ = updates;
    ++begun_anew_;
    spdlog::warn(
        "the evaluated return {:.1f} is below {:.1f}, {} times the offline policy's: the schedules "
        "begin anew at update {}",
        report->return_mean(), GuardedReturn(), config_.guard_share(), updates);
  }
  return {.multiplier = Geometric(config_.multiplier()),
          .temperature = Geometric(config_.temperature()),
          .target_entropy = Linear(config_.target_entropy())};
}

double Finetune::Progress(const ScheduleConfig& schedule) const {
  if (!decided_.has_value() || updates_ <= begun_) return 0;
  return std::min(1.0, static_cast<double>(updates_ - begun_) / static_cast<double>(schedule.updates()));
}

std::optional<double> Finetune::Geometric(const ScheduleConfig& schedule) const {
  if (schedule.updates() == 0) return std::nullopt;
  return schedule.first() * std::pow(schedule.last() / schedule.first(), Progress(schedule));
}

std::optional<double> Finetune::Linear(const ScheduleConfig& schedule) const {
  if (schedule.updates() == 0) return std::nullopt;
  return schedule.first() + Progress(schedule) * (schedule.last() - schedule.first());
}

Scalars Finetune::Metrics() const {
  if (!decided_.has_value()) return {};
  double progress = 1;
  for (const ScheduleConfig* schedule :
       {&config_.multiplier(), &config_.temperature(), &config_.target_entropy()}) {
    if (schedule->updates() > 0) progress = std::min(progress, Progress(*schedule));
  }
  return {{"finetune/begun_anew", static_cast<double>(begun_anew_)}, {"finetune/progress", progress}};
}

void Finetune::Save(TensorFile* file) const {
  if (!designed()) return;
  PutTensor<double>(kReturn, VectorX<double>::Constant(1, offline_return_), file);
  PutCounter(kMode, decided_.value_or(FinetuneConfig::NONE), file);
  PutCounter(kBegun, begun_, file);
  PutCounter(kBegunAnew, begun_anew_, file);
}

absl::Status Finetune::Load(const TensorFile& file) {
  if (!designed()) return absl::OkStatus();
  VectorX<double> offline_return(1);
  std::uint64_t mode = 0;
  absl::Status status = GetTensor(kReturn, file, &offline_return);
  status.Update(GetCounter(kMode, file, &mode));
  status.Update(GetCounter(kBegun, file, &begun_));
  status.Update(GetCounter(kBegunAnew, file, &begun_anew_));
  offline_return_ = offline_return[0];
  if (mode != FinetuneConfig::NONE) decided_ = static_cast<FinetuneConfig::Mode>(mode);
  return status;
}

}  // namespace dbr
