#include "learner/runtime/prefetcher.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "core/monotonic_clock.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {

Prefetcher::Prefetcher(ReplayClient* client, const PrefetcherOptions& options)
    : client_(client),
      options_(options),
      ready_(static_cast<std::size_t>(options.depth)),
      free_(static_cast<std::size_t>(options.depth) + 2),
      thread_([this] { Run(); }) {}

Prefetcher::~Prefetcher() {
  Close();
  thread_.join();
}

void Prefetcher::Close() {
  {
    absl::MutexLock lock(&mutex_);
    closed_ = true;
  }
  client_->Close();
  ready_.Close();
  free_.Close();
}

absl::StatusOr<std::unique_ptr<DrawnBatches>> Prefetcher::Next() {
  const bool waits = ready_.size() == 0;
  {
    absl::MutexLock lock(&mutex_);
    ++asked_;
    if (waits) ++waited_;
  }
  while (std::optional<Drawn> drawn = ready_.Pop()) {
    {
      absl::MutexLock lock(&mutex_);
      if (drawn->terms_set == terms_set_) return std::move(drawn->batches);
    }
    Recycle(std::move(drawn->batches));
  }
  absl::MutexLock lock(&mutex_);
  return final_.ok() ? absl::CancelledError("the prefetcher is closed") : final_;
}

void Prefetcher::SetTerms(const DrawTerms& terms) {
  absl::MutexLock lock(&mutex_);
  terms_ = terms;
  ++terms_set_;
}

void Prefetcher::Recycle(std::unique_ptr<DrawnBatches> batches) {
  free_.TryPush(std::move(batches));
}

double Prefetcher::starved_share() const {
  absl::MutexLock lock(&mutex_);
  return asked_ == 0 ? 0 : static_cast<double>(waited_) / static_cast<double>(asked_);
}

void Prefetcher::Run() {
  bool away = false;
  std::unique_ptr<DrawnBatches> batches;
  for (;;) {
    if (batches == nullptr)
      batches = free_.Pop(absl::ZeroDuration()).value_or(std::make_unique<DrawnBatches>());
    DrawTerms terms;
    std::uint64_t terms_set = 0;
    {
      absl::MutexLock lock(&mutex_);
      terms = terms_;
      terms_set = terms_set_;
    }
    const absl::Status status =
        client_->Sample(options_.counts, options_.layout, options_.call_timeout, batches.get(), terms);
    if (!status.ok()) {
      if (!HandleFailure(status, &away)) break;
      continue;
    }
    if (std::exchange(away, false)) spdlog::info("the replay server gives batches again");
    if (!ready_.Push({std::move(batches), terms_set})) break;
  }
  ready_.Close();
}

bool Prefetcher::HandleFailure(const absl::Status& status, bool* away) {
  absl::MutexLock lock(&mutex_);
  if (closed_) return false;
  if (IsFinal(status)) {
    final_ = status;
    return false;
  }
  if (absl::IsDeadlineExceeded(status)) return true;  // the rate limiter holds the draw
  if (!std::exchange(*away, true)) {
    spdlog::warn("the replay server gives no batches, trying again: {}", std::string(status.message()));
  }
  AwaitFor(&mutex_, absl::Condition(this, &Prefetcher::Closed), options_.retry_after);
  return !closed_;
}

}  // namespace dbr
