#include "replay/client/writer.h"

#include <algorithm>
#include <random>
#include <thread>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "core/monotonic_clock.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "proto/replay.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/grpc_status.h"
#include "proto/rpc/protocol.h"
#include "replay/client/outbox.h"
#include "spdlog/spdlog.h"

namespace dbr {
namespace {

constexpr absl::Duration kFirstBackoff = absl::Milliseconds(50);
constexpr absl::Duration kLongestBackoff = absl::Seconds(2);

std::uint64_t DrawId() {
  std::random_device device;
  return (std::uint64_t{device()} << 32 | device()) | 1;  // never 0
}

std::size_t RowsPerMessage(const WriterOptions& options) {
  const std::size_t row_bytes = static_cast<std::size_t>(options.layout.stride() + 3) * sizeof(float);
  const std::size_t rows = std::min(options.batch_bytes / row_bytes, options.buffered_transitions);
  return std::max<std::size_t>(rows, 1);
}

absl::Status CheckWidths(const TransitionLayout& layout, const TransitionView& transition) {
  absl::Status status;
  const auto check = [&status](const ColumnPlace& place, const auto* value) {
    const std::size_t found = FloatsOf(*value, place.width).size();
    if (!status.ok() || found == static_cast<std::size_t>(place.width)) return;
    status = absl::InvalidArgumentError(
        absl::StrCat(place.value, ": expected ", place.width, " values, found ", found));
  };
  ForEachColumn(check, layout.columns(), ValuesOf(transition));
  return status;
}

}  // namespace

// One thread connects and sends; while a stream lives a second one reads replies.
class TransitionWriter::Impl {
 public:
  explicit Impl(WriterOptions options)
      : options_(std::move(options)),
        id_(DrawId()),
        stub_(Replay::NewStub(MakeChannel(options_.address))),
        outbox_({.layout = options_.layout,
                 .rows_per_message = RowsPerMessage(options_),
                 .window = static_cast<std::size_t>(std::max(1, options_.window)),
                 .max_batch_age = options_.max_batch_age}),
        jitter_(id_),
        sender_([this] { Run(); }) {}

  ~Impl() {
    Close();
    sender_.join();
  }

  absl::Status Append(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                      const std::optional<EpisodeEnd>& end, absl::Duration timeout) {
    RETURN_IF_ERROR(CheckWidths(options_.layout, transition));
    const absl::Time now = MonotonicNow();
    absl::MutexLock lock(&mutex_);
    const auto has_room = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
      return Ended() || outbox_.appended() - outbox_.acknowledged() < options_.buffered_transitions;
    };
    RETURN_IF_ERROR(Await(has_room, timeout, "append: the buffer of this writer is full"));
    outbox_.Append(transition, advantage, critic_version, end, now);
    return absl::OkStatus();
  }

  absl::Status Flush(absl::Duration timeout) {
    absl::MutexLock lock(&mutex_);
    const auto all_acknowledged = [this, target = outbox_.appended()]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(
                                      mutex_) { return Ended() || outbox_.acknowledged() >= target; };
    return Await(all_acknowledged, timeout, "flush: not all is acknowledged");
  }

  void Close() {
    absl::MutexLock lock(&mutex_);
    closed_ = true;
    if (context_ != nullptr) context_->TryCancel();
  }

  std::uint64_t id() const { return id_; }

  WriterCounters counters() const {
    absl::MutexLock lock(&mutex_);
    return {outbox_.appended(), outbox_.acknowledged(), outbox_.refused(), reconnects_};
  }

 private:
  using Stream = grpc::ClientReaderWriter<InsertRequest, InsertReply>;

  bool Ended() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closed_ || !final_error_.ok(); }

  // Waits for `ready` as a caller for whom the sender hurries.
  template <class Ready>
  absl::Status Await(const Ready& ready, absl::Duration timeout, const char* what)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (!ready()) {
      ++callers_waiting_;
      AwaitFor(&mutex_, absl::Condition(&ready), timeout);
      --callers_waiting_;
    }
    if (!final_error_.ok()) return final_error_;
    if (closed_) return absl::CancelledError("the writer is closed");
    if (ready()) return absl::OkStatus();
    return absl::DeadlineExceededError(absl::StrCat(what, " after ", absl::FormatDuration(timeout), ": ",
                                                    outbox_.appended(), " appended, ", outbox_.acknowledged(),
                                                    " acknowledged by ", options_.address));
  }

  // Gives the message before back and waits for the next one to send; null where the stream is to end.
  const InsertRequest* NextMessage() ABSL_LOCKS_EXCLUDED(mutex_) {
    absl::MutexLock lock(&mutex_);
    outbox_.GiveBack();
    for (;;) {
      const absl::Time next_time = outbox_.NextTime(callers_waiting_ > 0);
      const auto sooner = [this, next_time]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
        return closed_ || broken_ || outbox_.NextTime(callers_waiting_ > 0) < next_time;
      };
      AwaitUntil(&mutex_, absl::Condition(&sooner), next_time);
      if (closed_ || broken_) return nullptr;
      if (const InsertRequest* message = outbox_.Next(MonotonicNow(), callers_waiting_ > 0)) return message;
    }
  }

  void ReadReplies(Stream* stream) ABSL_LOCKS_EXCLUDED(mutex_) {
    InsertReply reply;
    while (stream->Read(&reply)) {
      absl::MutexLock lock(&mutex_);
      outbox_.Acknowledge(reply);
    }
    absl::MutexLock lock(&mutex_);
    broken_ = true;
  }

  // Sends the opening message and takes its answer. Unavailable where the stream is broken: its end says why.
  // FailedPrecondition where the server speaks another protocol.
  absl::Status Open(Stream* stream) ABSL_LOCKS_EXCLUDED(mutex_) {
    InsertRequest opening;
    opening.set_writer_name(options_.name);
    opening.set_writer_id(id_);
    opening.set_protocol_version(kProtocolVersion);
    InsertReply reply;
    if (!stream->Write(opening) || !stream->Read(&reply)) return absl::UnavailableError("broken");
    RETURN_IF_ERROR(CheckProtocolVersion(reply.protocol_version(), "the replay server",
                                         absl::StrCat("the writer ", options_.name)));
    std::uint64_t resend;
    {
      absl::MutexLock lock(&mutex_);
      broken_ = false;
      outbox_.Restart();
      outbox_.Acknowledge(reply);
      if (lost_) ++reconnects_;
      resend = outbox_.appended() - outbox_.acknowledged();
    }
    if (std::exchange(lost_, false)) {
      spdlog::info(
          "{}: the replay server at {} is back; {} transitions are not acknowledged and are sent again",
          options_.name, options_.address, resend);
    }
    return absl::OkStatus();
  }

  // One stream from its opening to its end.
  absl::Status RunStream() ABSL_LOCKS_EXCLUDED(mutex_) {
    grpc::ClientContext context;
    // The first try fails at once where nobody answers, and so the loss is said. Later ones wait inside the
    // call: only a thread that waits there notices at once that the channel, which tries again and again by
    // itself, has got through.
    context.set_wait_for_ready(lost_);
    {
      absl::MutexLock lock(&mutex_);
      if (closed_) return absl::CancelledError("the writer is closed");
      context_ = &context;
    }
    const auto stream = stub_->Insert(&context);
    const absl::Status opened = Open(stream.get());
    if (opened.ok()) {
      failures_ = 0;
      std::thread reader([this, &stream] { ReadReplies(stream.get()); });
      while (const InsertRequest* message = NextMessage()) {
        if (!stream->Write(*message)) break;
      }
      reader.join();
      absl::MutexLock lock(&mutex_);
      outbox_.GiveBack();
    }
    if (IsFinal(opened)) context.TryCancel();
    const grpc::Status ended = stream->Finish();
    absl::MutexLock lock(&mutex_);
    context_ = nullptr;
    return IsFinal(opened) ? opened : FromGrpc(ended);
  }

  void Run() ABSL_LOCKS_EXCLUDED(mutex_) {
    for (;;) {
      const absl::Status status = RunStream();
      {
        absl::MutexLock lock(&mutex_);
        if (closed_) return;
        if (IsFinal(status)) final_error_ = status;
      }
      if (IsFinal(status)) {
        spdlog::error("{}: no more transitions to the replay server at {}: {}", options_.name,
                      options_.address, std::string(status.message()));
        return;
      }
      if (!std::exchange(lost_, true)) {
        spdlog::warn("{}: no stream to the replay server at {}: {}. Trying again until it is there.",
                     options_.name, options_.address, std::string(status.message()));
      }
      BackOff();
    }
  }

  void BackOff() ABSL_LOCKS_EXCLUDED(mutex_) {
    const absl::Duration longest =
        std::min(kLongestBackoff, kFirstBackoff * (1 << std::min(failures_++, 10)));
    const absl::Duration pause = longest * (0.5 + 0.5 * jitter_.Uniform());
    absl::MutexLock lock(&mutex_);
    AwaitFor(&mutex_, absl::Condition(&closed_), pause);
  }

  const WriterOptions options_;
  const std::uint64_t id_;
  const std::unique_ptr<Replay::Stub> stub_;

  mutable absl::Mutex mutex_;
  Outbox outbox_ ABSL_GUARDED_BY(mutex_);
  std::uint64_t reconnects_ ABSL_GUARDED_BY(mutex_) = 0;
  int callers_waiting_ ABSL_GUARDED_BY(mutex_) = 0;
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // the stream has ended
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status final_error_ ABSL_GUARDED_BY(mutex_);
  grpc::ClientContext* context_ ABSL_GUARDED_BY(mutex_) = nullptr;  // of the stream under way

  // The sending thread alone uses these.
  bool lost_ = false;
  int failures_ = 0;
  Rng jitter_;

  std::thread sender_;
};

TransitionWriter::TransitionWriter(WriterOptions options)
    : impl_(std::make_unique<Impl>(std::move(options))) {}
TransitionWriter::~TransitionWriter() = default;

absl::Status TransitionWriter::Append(const TransitionView& transition, float advantage,
                                      std::uint64_t critic_version, const std::optional<EpisodeEnd>& end,
                                      absl::Duration timeout) {
  return impl_->Append(transition, advantage, critic_version, end, timeout);
}
absl::Status TransitionWriter::Flush(absl::Duration timeout) {
  return impl_->Flush(timeout);
}
void TransitionWriter::Close() {
  impl_->Close();
}
std::uint64_t TransitionWriter::id() const {
  return impl_->id();
}
WriterCounters TransitionWriter::counters() const {
  return impl_->counters();
}

}  // namespace dbr
