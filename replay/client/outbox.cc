#include "replay/client/outbox.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "proto/rpc/codec.h"

namespace dbr {
namespace {

std::uint64_t LastSequence(const InsertRequest& message) {
  return message.first_sequence() + message.transitions().count() - 1;
}

}  // namespace

Outbox::Outbox(const OutboxOptions& options)
    : options_(options), messages_per_acknowledgement_(std::max<std::size_t>(1, options.window / 4)) {}

void Outbox::Append(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                    const std::optional<EpisodeEnd>& end, absl::Time now) {
  if (filling_ == nullptr) StartMessage(now);
  ++appended_;
  TransitionBatch* batch = filling_->mutable_transitions();
  if (end.has_value()) {
    EpisodeEndMessage* message = filling_->add_episode_ends();
    message->set_row(batch->count());
    message->set_return_(end->episode_return);
    message->set_score(end->score);
    message->set_length(static_cast<std::uint32_t>(end->length));
  }
  AppendTransition(transition, advantage, critic_version, batch);
  if (batch->count() == options_.rows_per_message) sealed_.push_back(std::move(filling_));
}

void Outbox::StartMessage(absl::Time now) {
  if (spare_.empty()) {
    filling_ = std::make_unique<InsertRequest>();
  } else {
    filling_ = std::move(spare_.back());
    spare_.pop_back();
    filling_->Clear();
  }
  filling_->set_first_sequence(appended_ + 1);
  SetLayout(options_.layout, filling_->mutable_transitions());
  filling_since_ = now;
}

absl::Time Outbox::NextTime(bool waited_for) const {
  if (!WindowOpen()) return absl::InfiniteFuture();
  if (CanSend()) return absl::InfinitePast();
  absl::Time since = absl::InfiniteFuture();
  if (filling_ != nullptr) since = filling_since_;
  if (sent_unasked_ > 0) since = std::min(since, last_sent_);
  if (waited_for && since != absl::InfiniteFuture()) return absl::InfinitePast();
  return since + options_.max_batch_age;
}

const InsertRequest* Outbox::Next(absl::Time now, bool waited_for) {
  DBR_CHECK(lent_ == nullptr);
  if (NextTime(waited_for) > now) return nullptr;
  const bool early = !CanSend();
  if (early && filling_ == nullptr) {
    question_.set_acknowledge(true);
    sent_unasked_ = 0;
    lent_ = &question_;
    return lent_;
  }
  if (early) sealed_.push_back(std::move(filling_));
  return Send(early, now);
}

const InsertRequest* Outbox::Send(bool early, absl::Time now) {
  InsertRequest* message = sealed_[sent_++].get();
  lent_ = message;
  last_sent_ = now;
  ++sent_unasked_;
  message->set_acknowledge(early || sent_unasked_ >= messages_per_acknowledgement_);
  if (message->acknowledge()) sent_unasked_ = 0;
  return message;
}

void Outbox::Acknowledge(const InsertReply& reply) {
  acknowledged_ = std::max(acknowledged_, std::min(reply.acknowledged_sequence(), appended_));
  refused_ = std::max(refused_, reply.refused());
  while (!sealed_.empty() && LastSequence(*sealed_.front()) <= acknowledged_) {
    std::unique_ptr<InsertRequest> message = std::move(sealed_.front());
    sealed_.pop_front();
    if (message.get() == lent_) {
      lent_acknowledged_ = std::move(message);
    } else {
      spare_.push_back(std::move(message));
    }
    if (sent_ > 0) --sent_;
  }
}

void Outbox::GiveBack() {
  lent_ = nullptr;
  if (lent_acknowledged_ != nullptr) spare_.push_back(std::move(lent_acknowledged_));
}

void Outbox::Restart() {
  sent_ = 0;
  sent_unasked_ = 0;
}

}  // namespace dbr
