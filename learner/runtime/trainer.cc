#include "learner/runtime/trainer.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "absl/time/clock.h"
#include "core/monotonic_clock.h"
#include "core/status_macros.h"
#include "learner/runtime/policy_service.h"
#include "learner/training/tensor_state.h"

namespace dbr {
namespace {
constexpr char kUpdates[] = "learner.updates";
constexpr char kVersion[] = "learner.policy_version";
// How far the learner is must be known also where it pushes seldom: the launcher waits for it.
constexpr absl::Duration kStatusEvery = absl::Milliseconds(500);
}  // namespace

Trainer::Trainer(const LearnerConfig& config, TrainerParts parts)
    : config_(config), parts_(std::move(parts)) {}

absl::Status Trainer::Load(const TensorFile& file) {
  RETURN_IF_ERROR(parts_.algorithm->Load(file));
  RETURN_IF_ERROR(parts_.finetune->Load(file));
  RETURN_IF_ERROR(GetCounter(kUpdates, file, &updates_));
  return GetCounter(kVersion, file, &snapshot_.version);
}

absl::Status Trainer::Run() {
  last_record_ = last_checkpoint_ = MonotonicNow();
  updates_at_record_ = updates_;
  const std::uint64_t updates_before = updates_;
  parts_.prefetcher->SetTerms(parts_.finetune->terms());
  Publish();
  const End end = UpdateToTheEnd();
  if (!end.state_is_sound) return end.status;                          // the checkpoints before it stay
  if (updates_ == updates_before && !end.finished) return end.status;  // so does what was saved before
  Publish();
  const absl::Status saved = Save();
  if (!end.status.ok()) return end.status;
  RETURN_IF_ERROR(saved);
  if (end.finished) {
    SetStatus(/*finished=*/true);
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(&stopping_));
  }
  return absl::OkStatus();
}

void Trainer::Stop() {
  {
    absl::MutexLock lock(&mutex_);
    stopping_ = true;
  }
  parts_.finetune->Close();
  parts_.prefetcher->Close();
}

bool Trainer::Stopping() {
  absl::MutexLock lock(&mutex_);
  return stopping_;
}

absl::Status Trainer::Save() {
  const absl::Status saved = parts_.saver->SaveNow(MakeCheckpoint());
  if (saved.ok()) {
    spdlog::info("saved at update {}", updates_);
  } else {
    spdlog::error("no checkpoint at update {}: {}", updates_, std::string(saved.message()));
  }
  return saved;
}

Trainer::End Trainer::UpdateToTheEnd() {
  while (config_.max_updates() == 0 || updates_ < config_.max_updates()) {
    if (parts_.finetune->IsBetweenPhases(updates_) && !PassBetweenPhases())
      return {.status = absl::OkStatus()};
    absl::StatusOr<std::unique_ptr<DrawnBatches>> drawn = parts_.prefetcher->Next();
    if (!drawn.ok()) return {.status = Stopping() ? absl::OkStatus() : drawn.status()};
    const absl::Status updated = Update(*std::move(drawn));
    if (!updated.ok()) return {.status = updated, .state_is_sound = false};
  }
  return {.status = absl::OkStatus(), .finished = true};
}

bool Trainer::PassBetweenPhases() {
  spdlog::info("the offline phase is over after {} updates: waiting for an evaluation of its policy",
               updates_);
  snapshot_.ends_offline_phase = true;
  Publish();
  snapshot_.ends_offline_phase = false;
  parts_.saver->Offer(MakeCheckpoint());
  const std::optional<double> offline_return = parts_.finetune->AwaitOfflineReturn(updates_);
  if (!offline_return.has_value()) return false;
  parts_.finetune->Decide(updates_, *offline_return);
  parts_.prefetcher->SetTerms(parts_.finetune->terms());
  spdlog::info("{}", parts_.finetune->Text());
  SetStatus(/*finished=*/false);
  return true;
}

absl::Status Trainer::Update(std::unique_ptr<DrawnBatches> drawn) {
  parts_.algorithm->SetControls(parts_.finetune->ControlsAt(updates_));
  RETURN_IF_ERROR(parts_.algorithm->Update({drawn->uniform, drawn->plus, drawn->minus}));
  parts_.relabeller->Offer(snapshot_.version, drawn->uniform.keys, parts_.algorithm->advantages());
  parts_.prefetcher->Recycle(std::move(drawn));
  ++updates_;
  if (updates_ % config_.push_every() == 0) Publish();
  if (updates_ % config_.metrics_every() == 0) Record();
  if (MonotonicNow() - last_status_ >= kStatusEvery) SetStatus(/*finished=*/false);
  if (config_.keep_policy_every() > 0 && updates_ % config_.keep_policy_every() == 0) KeepPolicy();
  MaybeCheckpoint();
  return absl::OkStatus();
}

void Trainer::KeepPolicy() {
  PolicySnapshot kept;
  parts_.algorithm->ExportPolicy(&kept);
  kept.version = snapshot_.version;
  kept.updates = updates_;
  parts_.saver->KeepPolicy(std::move(kept));
}

void Trainer::Publish() {
  parts_.algorithm->ExportPolicy(&snapshot_);
  ++snapshot_.version;
  snapshot_.updates = updates_;
  parts_.policy_service->Publish(snapshot_);
  SetStatus(/*finished=*/false);
}

void Trainer::SetStatus(bool finished) {
  last_status_ = MonotonicNow();
  LearnerStatus status;
  status.set_updates(updates_);
  status.set_policy_version(snapshot_.version);
  const double seconds = absl::ToDoubleSeconds(MonotonicNow() - last_record_);
  const double since_record = static_cast<double>(updates_ - updates_at_record_);
  status.set_updates_per_second(seconds > 1 ? since_record / seconds : updates_per_second_);
  status.set_finished(finished);
  status.set_matrix_products(parts_.matrix_products);
  status.set_finetuning(parts_.finetune->Text());
  for (const UpdateMetric& metric : parts_.algorithm->metrics()) {
    Metric* entry = status.add_metrics();
    entry->set_name(metric.name);
    entry->set_value(metric.value);
  }
  parts_.policy_service->SetStatus(std::move(status));
}

void Trainer::Record() {
  const absl::Time now = MonotonicNow();
  updates_per_second_ =
      static_cast<double>(updates_ - updates_at_record_) / absl::ToDoubleSeconds(now - last_record_);
  last_record_ = now;
  updates_at_record_ = updates_;
  Scalars scalars = {{tags::kUpdates, static_cast<double>(updates_)},
                     {"time/updates_per_second", updates_per_second_},
                     {"learner/starved_share", parts_.prefetcher->starved_share()},
                     {"learner/labels_dropped", static_cast<double>(parts_.relabeller->dropped())}};
  for (const UpdateMetric& metric : parts_.algorithm->metrics())
    scalars.emplace_back(metric.name, metric.value);
  const Scalars of_finetuning = parts_.finetune->Metrics();
  scalars.insert(scalars.end(), of_finetuning.begin(), of_finetuning.end());
  if (const absl::Status status =
          parts_.metrics->Write(static_cast<std::int64_t>(updates_), absl::Now(), scalars);
      !status.ok()) {
    spdlog::error("metrics: {}", std::string(status.message()));
  }
}

void Trainer::MaybeCheckpoint() {
  const absl::Time now = MonotonicNow();
  if (now - last_checkpoint_ < absl::Seconds(config_.checkpoint_every_s())) return;
  last_checkpoint_ = now;
  parts_.saver->Offer(MakeCheckpoint());
}

Checkpoint Trainer::MakeCheckpoint() {
  Checkpoint checkpoint;
  checkpoint.updates = updates_;
  parts_.algorithm->Save(&checkpoint.state);
  parts_.finetune->Save(&checkpoint.state);
  PutCounter(kUpdates, updates_, &checkpoint.state);
  PutCounter(kVersion, snapshot_.version, &checkpoint.state);
  parts_.algorithm->ExportPolicy(&checkpoint.policy);
  checkpoint.policy.version = snapshot_.version;
  checkpoint.policy.updates = updates_;
  return checkpoint;
}

}  // namespace dbr
