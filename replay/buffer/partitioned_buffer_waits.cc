// How inserts and draws of PartitionedBuffer wait.
#include "absl/strings/str_cat.h"
#include "replay/buffer/partitioned_buffer.h"

namespace dbr {
namespace {

absl::Status Stopping() {
  return absl::UnavailableError("the replay server is stopping");
}

}  // namespace

RateLimiter::Counts PartitionedBuffer::Counts() const {
  const StoreCounters& counters = store_->counters();
  return {.inserted = store_->online_inserted(),
          .sampled = counters.sampled - counters.sampled_offline,
          .size = store_->size(),
          .seed_buffer = store_->seed_buffer_rows()};
}

// A draw that waits for an empty partition can only be helped by an insert or a relabel, and who draws may be
// who relabels: so inserts are free meanwhile.
bool PartitionedBuffer::CanInsert() const {
  return limiter_.CanInsert(Counts()) || (waiting_.draws_of_plus > 0 && partitions_.size(kPlus) == 0) ||
         (waiting_.draws_of_minus > 0 && partitions_.size(kMinus) == 0);
}

absl::Status PartitionedBuffer::AwaitInsert(absl::Time deadline) {
  const auto ready = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closed_ || CanInsert(); };
  if (!ready()) {
    ++waiting_.inserts;
    mutex_.AwaitWithDeadline(absl::Condition(&ready), deadline);
    --waiting_.inserts;
  }
  if (closed_) return Stopping();
  if (CanInsert()) return absl::OkStatus();
  return absl::DeadlineExceededError(absl::StrCat("insert: ", limiter_.WhyInsertWaits(Counts())));
}

std::uint64_t PartitionedBuffer::EffectiveDraws(const DrawRequest& request) const {
  std::uint64_t draws = 0;
  for (int part = 0; part < kDrawnParts; ++part) {
    if (!request.allow_empty_partitions || partitions_.size(part) > 0) draws += request.counts[part];
  }
  return draws;
}

bool PartitionedBuffer::CanDraw(const DrawRequest& request) const {
  if (!limiter_.CanDraw(Counts(), EffectiveDraws(request))) return false;
  if (request.allow_empty_partitions) return true;
  return (request.counts[kPlus] == 0 || partitions_.size(kPlus) > 0) &&
         (request.counts[kMinus] == 0 || partitions_.size(kMinus) > 0);
}

std::string PartitionedBuffer::WhyDrawWaits(const DrawRequest& request) const {
  const std::uint64_t draws = EffectiveDraws(request);
  if (!limiter_.CanDraw(Counts(), draws)) return limiter_.WhyDrawWaits(Counts(), draws);
  const bool plus = request.counts[kPlus] > 0 && partitions_.size(kPlus) == 0;
  return absl::StrCat("partition ", plus ? "D+" : "D-", " is empty (of ", partitions_.size(kAll),
                      " transitions ", partitions_.size(kUnjudgedPart),
                      " are not yet judged); set allow_empty_partitions to draw without it");
}

absl::Status PartitionedBuffer::AwaitDraw(const DrawRequest& request, absl::Time deadline) {
  const auto ready = [this, &request]()
                         ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closed_ || CanDraw(request); };
  if (!ready()) {
    const bool must_have = !request.allow_empty_partitions;
    const bool plus = must_have && request.counts[kPlus] > 0, minus = must_have && request.counts[kMinus] > 0;
    ++waiting_.draws;
    waiting_.draws_of_plus += plus;
    waiting_.draws_of_minus += minus;
    waiting_.newest_draw = request;
    mutex_.AwaitWithDeadline(absl::Condition(&ready), deadline);
    --waiting_.draws;
    waiting_.draws_of_plus -= plus;
    waiting_.draws_of_minus -= minus;
  }
  if (closed_) return Stopping();
  if (CanDraw(request)) return absl::OkStatus();
  return absl::DeadlineExceededError(absl::StrCat("sample: ", WhyDrawWaits(request)));
}

void PartitionedBuffer::AddBlocked(BufferStats* stats) const {
  // A call that may go on, and only has not run yet, is not blocked.
  if (waiting_.inserts > 0 && !CanInsert()) {
    stats->blocked.push_back({"insert", waiting_.inserts, limiter_.WhyInsertWaits(Counts())});
  }
  if (waiting_.draws > 0 && !CanDraw(waiting_.newest_draw)) {
    stats->blocked.push_back({"sample", waiting_.draws, WhyDrawWaits(waiting_.newest_draw)});
  }
}

}  // namespace dbr
