#include "replay/buffer/admission.h"

#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"

namespace dbr {

RateLimiter::Counts CountsOf(const TransitionStore& store) {
  const StoreCounters& counters = store.counters();
  return {.inserted = store.online_inserted(),
          .sampled = counters.sampled - counters.sampled_offline,
          .size = store.size(),
          .seed_buffer = store.seed_buffer_rows()};
}

Admission::Admission(const RateLimiter& limiter, const TransitionStore* store, const Partitions* partitions)
    : limiter_(limiter), store_(*store), partitions_(*partitions) {}

absl::Status Admission::CheckOpen() const {
  return closed_ ? absl::UnavailableError("the replay server is stopping") : absl::OkStatus();
}

double Admission::MakeRoomFor(std::uint64_t draws) {
  return limiter_.MakeRoomFor(draws) ? limiter_.options().tolerance : 0;
}

bool Admission::CanInsert() const {
  return limiter_.CanInsert(CountsOf(store_)) ||
         (waiting_.draws_of_plus > 0 && partitions_.size(kPlus) == 0) ||
         (waiting_.draws_of_minus > 0 && partitions_.size(kMinus) == 0);
}

absl::Status Admission::AwaitInsert(absl::Mutex* mutex, absl::Time deadline) {
  const auto ready = [this] { return closed_ || CanInsert(); };
  if (!ready()) {
    ++waiting_.inserts;
    AwaitUntil(mutex, absl::Condition(&ready), deadline);
    --waiting_.inserts;
  }
  if (closed_) return CheckOpen();
  if (CanInsert()) return absl::OkStatus();
  return absl::DeadlineExceededError(absl::StrCat("insert: ", WhyInsertWaits()));
}

std::uint64_t Admission::EffectiveDraws(const DrawRequest& request) const {
  std::uint64_t draws = 0;
  for (int part = 0; part < kDrawnParts; ++part) {
    if (!request.allow_empty_partitions || partitions_.size(part) > 0) draws += request.counts[part];
  }
  return draws;
}

bool Admission::CanDraw(const DrawRequest& request) const {
  if (!limiter_.CanDraw(CountsOf(store_), EffectiveDraws(request))) return false;
  if (request.allow_empty_partitions) return true;
  return (request.counts[kPlus] == 0 || partitions_.size(kPlus) > 0) &&
         (request.counts[kMinus] == 0 || partitions_.size(kMinus) > 0);
}

std::string Admission::WhyDrawWaits(const DrawRequest& request) const {
  const std::uint64_t draws = EffectiveDraws(request);
  if (!limiter_.CanDraw(CountsOf(store_), draws)) return limiter_.WhyDrawWaits(CountsOf(store_), draws);
  const bool plus = request.counts[kPlus] > 0 && partitions_.size(kPlus) == 0;
  return absl::StrCat("partition ", plus ? "D+" : "D-", " is empty (of ", partitions_.size(kAll),
                      " transitions ", partitions_.size(kUnjudgedPart),
                      " are not yet judged); set allow_empty_partitions to draw without it");
}

absl::Status Admission::AwaitDraw(absl::Mutex* mutex, const DrawRequest& request, absl::Time deadline) {
  const auto ready = [this, &request] { return closed_ || CanDraw(request); };
  if (!ready()) {
    const bool must_have = !request.allow_empty_partitions;
    const bool plus = must_have && request.counts[kPlus] > 0, minus = must_have && request.counts[kMinus] > 0;
    ++waiting_.draws;
    waiting_.draws_of_plus += plus;
    waiting_.draws_of_minus += minus;
    waiting_.newest_draw = request;
    AwaitUntil(mutex, absl::Condition(&ready), deadline);
    --waiting_.draws;
    waiting_.draws_of_plus -= plus;
    waiting_.draws_of_minus -= minus;
  }
  if (closed_) return CheckOpen();
  if (CanDraw(request)) return absl::OkStatus();
  return absl::DeadlineExceededError(absl::StrCat("sample: ", WhyDrawWaits(request)));
}

std::vector<BlockedCalls> Admission::Blocked() const {
  std::vector<BlockedCalls> blocked;
  // A call that may go on, and only has not run yet, is not blocked.
  if (waiting_.inserts > 0 && !CanInsert()) blocked.push_back({"insert", waiting_.inserts, WhyInsertWaits()});
  if (waiting_.draws > 0 && !CanDraw(waiting_.newest_draw)) {
    blocked.push_back({"sample", waiting_.draws, WhyDrawWaits(waiting_.newest_draw)});
  }
  return blocked;
}

}  // namespace dbr
