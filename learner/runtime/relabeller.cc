#include "learner/runtime/relabeller.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

namespace dbr {
namespace {
constexpr std::size_t kQueuedUpdates = 64;
constexpr absl::Duration kCallTimeout = absl::Seconds(5);
}  // namespace

Relabeller::Relabeller(ReplayClient* client)
    : client_(client), queue_(kQueuedUpdates), thread_([this] { Run(); }) {}

Relabeller::~Relabeller() {
  Close();
  thread_.join();
}

void Relabeller::Close() {
  queue_.Close();
}

void Relabeller::Offer(std::uint64_t critic_version, absl::Span<const std::uint64_t> keys,
                       absl::Span<const float> advantages) {
  Labels labels{critic_version, {keys.begin(), keys.end()}, {advantages.begin(), advantages.end()}};
  if (!queue_.TryPush(std::move(labels))) dropped_.fetch_add(keys.size(), std::memory_order_relaxed);
}

void Relabeller::Run() {
  bool away = false;
  while (std::optional<Labels> labels = queue_.Pop()) {
    if (queue_.closed()) return;
    const auto reply =
        client_->Relabel(labels->critic_version, labels->keys, labels->advantages, kCallTimeout);
    if (reply.ok()) {
      away = false;
      continue;
    }
    dropped_.fetch_add(labels->keys.size(), std::memory_order_relaxed);
    if (!std::exchange(away, true) && !absl::IsCancelled(reply.status())) {
      spdlog::warn("advantages are not taken by the replay server: {}",
                   std::string(reply.status().message()));
    }
  }
}

}  // namespace dbr
