#include "learner/metrics/metrics_sink.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "learner/metrics/repeated_rows.h"

namespace dbr {
namespace {

double Seconds(absl::Time time) {
  return absl::ToDoubleSeconds(time - absl::UnixEpoch());
}

// One line; the library writes what is not finite as null.
std::string JsonRow(std::int64_t step, double wall_time, const Scalars& scalars) {
  nlohmann::ordered_json row = {{"step", step}, {"wall_time", wall_time}};
  for (const auto& [tag, value] : scalars) row[tag] = value;
  return row.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace

absl::StatusOr<std::unique_ptr<MetricsSink>> MetricsSink::Open(const RunFolder& folder,
                                                               absl::Duration flush_interval, absl::Time now,
                                                               std::function<absl::Time()> clock) {
  ASSIGN_OR_RETURN(auto rows, AppendFile::Open(folder.metrics()));
  RETURN_IF_ERROR(rows->DropPartialLine());
  ASSIGN_OR_RETURN(auto events,
                   AppendFile::Open(absl::StrCat(folder.root, "/", EventFileName(Seconds(now)))));
  RETURN_IF_ERROR(events->Append(VersionRecord(Seconds(now))));
  return std::unique_ptr<MetricsSink>(new MetricsSink(folder.metrics(), std::move(rows), std::move(events),
                                                      flush_interval, std::move(clock)));
}

MetricsSink::MetricsSink(std::string path, std::unique_ptr<AppendFile> rows,
                         std::unique_ptr<AppendFile> events, absl::Duration flush_interval,
                         std::function<absl::Time()> clock)
    : path_(std::move(path)),
      rows_(std::move(rows)),
      events_(std::move(events)),
      flush_interval_(flush_interval),
      clock_(std::move(clock)),
      last_write_(clock_()) {}

MetricsSink::~MetricsSink() {
  Flush().IgnoreError();
}

absl::Status MetricsSink::StartSession(std::int64_t step, absl::Time now) {
  {
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(this, &MetricsSink::Idle));
    writing_ = true;
  }
  absl::Status status = events_->Append(SessionStartRecord(step, Seconds(now)));
  if (status.ok()) status = RepeatWhatHolds(path_, step, events_.get());
  absl::MutexLock lock(&mutex_);
  writing_ = false;
  return status;
}

absl::Status MetricsSink::Write(std::int64_t step, absl::Time now, const Scalars& scalars) {
  const std::string row = JsonRow(step, Seconds(now), scalars);
  const std::string event = ScalarRecord(step, Seconds(now), scalars);
  {
    absl::MutexLock lock(&mutex_);
    pending_rows_ += row;
    pending_events_ += event;
    const absl::Time here = clock_();
    if (writing_ || here - last_write_ < flush_interval_) return absl::OkStatus();
    writing_ = true;
    last_write_ = here;
  }
  return WritePending();
}

absl::Status MetricsSink::Flush() {
  {
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(this, &MetricsSink::Idle));
    writing_ = true;
  }
  return WritePending();
}

absl::Status MetricsSink::WritePending() {
  std::string rows, events;
  {
    absl::MutexLock lock(&mutex_);
    rows.swap(pending_rows_);
    events.swap(pending_events_);
  }
  absl::Status status = rows_->Append(rows);
  const bool rows_written = status.ok();
  const absl::Status events_status = events_->Append(events);
  status.Update(events_status);
  absl::MutexLock lock(&mutex_);
  if (!rows_written) pending_rows_.insert(0, rows);
  if (!events_status.ok()) pending_events_.insert(0, events);
  writing_ = false;
  return status;
}

}  // namespace dbr
