#include "learner/runtime/saver.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "core/status_macros.h"

namespace dbr {

Saver::Saver(const RunFolder& folder, int keep)
    : folder_(folder), checkpoints_(folder.checkpoints(), keep), queue_(1), thread_([this] { Run(); }) {
  std::error_code error;
  std::filesystem::create_directories(folder_.policies(), error);
}

Saver::~Saver() {
  queue_.Close();
  thread_.join();
}

bool Saver::Offer(Checkpoint checkpoint) {
  return queue_.TryPush(std::move(checkpoint));
}

absl::Status Saver::SaveNow(const Checkpoint& checkpoint) {
  absl::MutexLock lock(&writing_);
  if (checkpoint.updates < written_) return absl::OkStatus();
  RETURN_IF_ERROR(checkpoints_.Save(checkpoint.updates, checkpoint.state));
  RETURN_IF_ERROR(SavePolicy(checkpoint.policy, folder_.latest_policy()));
  written_ = checkpoint.updates;
  return absl::OkStatus();
}

void Saver::KeepPolicy(PolicySnapshot policy) {
  queue_.Push(std::move(policy));
}

absl::Status Saver::Write(const Work& work) {
  if (const auto* checkpoint = std::get_if<Checkpoint>(&work)) return SaveNow(*checkpoint);
  const PolicySnapshot& policy = std::get<PolicySnapshot>(work);
  absl::MutexLock lock(&writing_);
  return SavePolicy(policy, folder_.kept_policy(policy.updates));
}

void Saver::Run() {
  while (const std::optional<Work> work = queue_.Pop()) {
    if (const absl::Status status = Write(*work); !status.ok()) {
      spdlog::error("not saved: {}", std::string(status.message()));
    }
  }
}

}  // namespace dbr
