#include "replay/service/service_codec.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "proto/rpc/codec.h"

namespace dbr {
namespace {

constexpr std::uint64_t kMaxReplyBytes = 256 << 20;

SampledPart* PartOf(int part, SampleReply* reply) {
  return part == kAll    ? reply->mutable_uniform()
         : part == kPlus ? reply->mutable_plus()
                         : reply->mutable_minus();
}

// Makes a field `size` long and returns its memory, without writing zeros first; null for none.
template <class Value>
Value* Room(std::size_t size, google::protobuf::RepeatedField<Value>* field) {
  if (size == 0) return nullptr;
  field->Reserve(static_cast<int>(size));
  return field->AddNAlreadyReserved(static_cast<int>(size));
}

DrawColumns RoomForPart(std::size_t count, const TransitionLayout& layout, SampledPart* part) {
  DrawColumns room;
  room.keys = Room(count, part->mutable_keys());
  ForEachColumn(
      [count](const ColumnPlace& place, auto* field, float*& column) {
        column = Room(count * static_cast<std::size_t>(place.width), field);
      },
      layout.columns(), ColumnsIn(part->mutable_transitions()), room);
  return room;
}

// Views into `batch`, which has passed CheckShape.
InsertColumns ViewColumns(const TransitionBatch& batch) {
  InsertColumns columns;
  columns.count = static_cast<int>(batch.count());
  ForEachColumn([](const auto* field, const float*& column) { column = field->data(); }, ColumnsIn(batch),
                columns);
  columns.advantages = batch.advantages().empty() ? nullptr : batch.advantages().data();
  columns.critic_versions = batch.critic_versions().empty() ? nullptr : batch.critic_versions().data();
  return columns;
}

void EncodeWriter(const WriterSummary& summary, WriterStats* writer) {
  writer->set_name(summary.identity.name);
  writer->set_id(summary.identity.id);
  writer->set_source(summary.identity.source == Source::kSeedBuffer ? SEED_BUFFER : ONLINE);
  writer->set_inserted(summary.inserted);
  writer->set_last_sequence(summary.last_sequence);
  writer->set_duplicates(summary.duplicates);
  writer->set_refused(summary.refused);
  writer->set_held(summary.held);
  writer->set_connected(summary.connected);
}

void EncodeCounts(const BufferStats& stats, StatsReply* reply) {
  reply->set_total(stats.total);
  reply->set_plus(stats.plus);
  reply->set_minus(stats.minus);
  reply->set_unjudged(stats.unjudged);
  reply->set_seed_buffer(stats.seed_buffer);
  reply->set_seed_buffer_plus(stats.seed_buffer_plus);
  reply->set_seed_buffer_minus(stats.seed_buffer_minus);
  reply->set_capacity(stats.capacity);
  reply->set_bytes(stats.bytes);
  reply->set_inserted(stats.inserted);
  reply->set_sampled(stats.counters.sampled);
  reply->set_evicted(stats.evicted);
  reply->set_relabelled(stats.counters.relabelled);
  reply->set_relabel_evicted(stats.counters.relabel_evicted);
  reply->set_relabel_stale(stats.counters.relabel_stale);
  reply->set_refused(stats.counters.refused);
  reply->set_duplicates(stats.counters.duplicates);
  reply->set_episodes(stats.counters.episodes);
  reply->set_sampled_offline(stats.counters.sampled_offline);
}

void EncodeSeedBuffer(const BufferStats& stats, StatsReply* reply) {
  const SeedBufferRecord& record = stats.seed_buffer_record;
  const auto number = [&record](double value) { return record.complete != 0 ? value : std::nan(""); };
  reply->set_seed_buffer_rows(stats.seed_buffer_rows);
  reply->set_seed_buffer_bad_rows(record.bad_rows);
  reply->set_seed_buffer_episodes(record.episodes);
  reply->set_seed_buffer_return_mean(number(record.return_mean));
  reply->set_seed_buffer_return_std(number(record.return_std));
  reply->set_seed_buffer_return_min(number(record.return_min));
  reply->set_seed_buffer_return_max(number(record.return_max));
  reply->set_seed_buffer_rows_per_second(record.rows_per_second);
  reply->set_seed_buffer_actions_outside(record.actions_outside);
}

}  // namespace

absl::StatusOr<WriterIdentity> DecodeOpening(const InsertRequest& request) {
  if (request.has_transitions()) {
    return absl::InvalidArgumentError(
        "the first message of a stream: expected a writer's name and id and no transitions, found "
        "transitions");
  }
  return WriterIdentity{.id = request.writer_id(), .name = request.writer_name()};
}

absl::StatusOr<InsertBatch> DecodeInsert(const InsertRequest& request, const TransitionLayout& layout,
                                         std::vector<RowEnd>* ends) {
  const TransitionBatch& batch = request.transitions();
  RETURN_IF_ERROR(CheckShape(batch, layout));
  ends->clear();
  for (const EpisodeEndMessage& end : request.episode_ends()) {
    if (end.row() >= batch.count()) {
      return absl::InvalidArgumentError(
          absl::StrCat("episode_ends: expected a row below ", batch.count(), ", found ", end.row()));
    }
    ends->push_back(
        {static_cast<int>(end.row()), {end.return_(), end.score(), static_cast<int>(end.length())}});
  }
  InsertBatch decoded;
  decoded.first_sequence = request.first_sequence();
  decoded.ends = *ends;
  decoded.columns = ViewColumns(batch);
  return decoded;
}

absl::StatusOr<DrawRequest> DecodeSample(const SampleRequest& request, const TransitionLayout& layout) {
  const std::uint64_t row_bytes =
      static_cast<std::uint64_t>(layout.stride()) * sizeof(float) + sizeof(std::uint64_t);
  const std::uint64_t asked = std::uint64_t{request.uniform()} + request.plus() + request.minus();
  if (asked > kMaxReplyBytes / row_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("sample: expected at most ", kMaxReplyBytes / row_bytes,
                                                   " transitions of ", row_bytes,
                                                   " bytes in one call, found ", asked));
  }
  DrawRequest draw{.counts = {request.uniform(), request.plus(), request.minus()},
                   .allow_empty_partitions = request.allow_empty_partitions(),
                   .first_transitions = request.first_transitions()};
  if (request.has_seed_buffer_share()) {
    const double share = request.seed_buffer_share();
    if (!(share >= 0 && share <= 1)) {
      return absl::InvalidArgumentError(
          absl::StrCat("sample: seed_buffer_share: expected 0 to 1, found ", share));
    }
    draw.seed_buffer_share = share;
  }
  return draw;
}

DrawBuffers MakeRoom(const DrawRequest& request, const TransitionLayout& layout, SampleReply* reply) {
  DrawBuffers buffers;
  for (int part = 0; part < kDrawnParts; ++part) {
    buffers[part] = RoomForPart(request.counts[part], layout, PartOf(part, reply));
  }
  return buffers;
}

void Encode(const DrawResult& result, const TransitionLayout& layout, SampleReply* reply) {
  for (int part = 0; part < kDrawnParts; ++part) {
    SampledPart* message = PartOf(part, reply);
    if (result.drawn[part] == 0) message->Clear();
    message->mutable_transitions()->set_count(result.drawn[part]);
    SetLayout(layout, message->mutable_transitions());
  }
  reply->set_total_size(result.total);
  reply->set_plus_size(result.plus);
  reply->set_minus_size(result.minus);
  reply->set_unjudged_size(result.unjudged);
  reply->set_inserted(result.inserted);
  reply->set_episodes(result.episodes);
}

void Encode(const RelabelResult& result, RelabelReply* reply) {
  reply->set_relabelled(result.relabelled);
  reply->set_evicted(result.evicted);
  reply->set_stale(result.stale);
  reply->set_refused(result.refused);
}

void Encode(const BufferStats& stats, StatsReply* reply) {
  EncodeCounts(stats, reply);
  EncodeSeedBuffer(stats, reply);
  reply->set_insert_rate(stats.insert_rate);
  reply->set_sample_rate(stats.sample_rate);
  reply->set_relabel_rate(stats.relabel_rate);
  reply->set_samples_per_insert(stats.samples_per_insert);
  reply->set_newest_critic_version(stats.counters.newest_label);
  reply->set_label_age_mean(stats.labels.age_mean);
  reply->set_label_age_p95(stats.labels.age_p95);
  reply->mutable_advantage_edges()->Assign(stats.labels.edges.begin(), stats.labels.edges.end());
  reply->mutable_advantage_histogram()->Assign(stats.labels.histogram.begin(), stats.labels.histogram.end());
  for (const WriterSummary& writer : stats.writers) EncodeWriter(writer, reply->add_writers());
  for (const BlockedCalls& blocked : stats.blocked) {
    BlockedClients* message = reply->add_blocked();
    message->set_call(blocked.call);
    message->set_clients(blocked.clients);
    message->set_why(blocked.why);
  }
  reply->set_recent_return_mean(stats.recent_return_mean);
  reply->set_recent_score_mean(stats.recent_score_mean);
  reply->set_recent_length_mean(stats.recent_length_mean);
  reply->set_uptime_s(stats.uptime_s);
}

}  // namespace dbr
