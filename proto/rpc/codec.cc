#include "proto/rpc/codec.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

using Column = google::protobuf::RepeatedField<float>;

absl::Status CheckColumn(const char* name, const Column& column, int count, int width) {
  if (column.size() == static_cast<std::int64_t>(count) * width) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("column '", name, "': expected ", count, " rows of ", width,
                                                 " values, found ", column.size(), " values"));
}

absl::Status CheckWidth(const char* name, int expected, std::uint32_t found) {
  if (static_cast<std::uint32_t>(expected) == found) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(name, ": expected ", expected, ", found ", found,
                   ". Writers and readers of one replay server share one environment and one algorithm."));
}

// The widths that `batch` says it has.
TransitionLayout LayoutOf(const TransitionBatch& batch) {
  return {.observation_width = static_cast<int>(batch.observation_width()),
          .action_width = static_cast<int>(batch.action_width()),
          .mask_width = static_cast<int>(batch.mask_width()),
          .return_width = static_cast<int>(batch.return_width()),
          .next_action_width = static_cast<int>(batch.next_action_width())};
}

void Append(absl::Span<const float> values, int, Column* column) {
  const int old_size = column->size();
  column->Resize(old_size + static_cast<int>(values.size()), 0.0f);
  std::copy(values.begin(), values.end(), column->mutable_data() + old_size);
}
void Append(float value, int width, Column* column) {
  if (width > 0) column->Add(value);
}

template <class Matrix>
void CopyColumn(const Column& column, Matrix* matrix) {
  if (!column.empty()) std::memcpy(matrix->data(), column.data(), sizeof(float) * column.size());
}

}  // namespace

void SetLayout(const TransitionLayout& layout, TransitionBatch* batch) {
  batch->set_observation_width(layout.observation_width);
  batch->set_action_width(layout.action_width);
  batch->set_mask_width(layout.mask_width);
  batch->set_return_width(layout.return_width);
  batch->set_next_action_width(layout.next_action_width);
}

absl::Status CheckShape(const TransitionBatch& batch, const TransitionLayout& layout) {
  RETURN_IF_ERROR(CheckWidth("observation_width", layout.observation_width, batch.observation_width()));
  RETURN_IF_ERROR(CheckWidth("action_width", layout.action_width, batch.action_width()));
  RETURN_IF_ERROR(CheckWidth("mask_width", layout.mask_width, batch.mask_width()));
  RETURN_IF_ERROR(CheckWidth("return_width", layout.return_width, batch.return_width()));
  RETURN_IF_ERROR(CheckWidth("next_action_width", layout.next_action_width, batch.next_action_width()));
  constexpr std::uint32_t kMaxRows = 1u << 24;
  if (batch.count() > kMaxRows) {
    return absl::InvalidArgumentError(
        absl::StrCat("count: expected at most ", kMaxRows, ", found ", batch.count()));
  }
  const int n = static_cast<int>(batch.count());
  absl::Status status;
  ForEachColumn(
      [&status, n](const ColumnPlace& place, const Column* column) {
        if (status.ok()) status = CheckColumn(place.name, *column, n, place.width);
      },
      layout.columns(), ColumnsIn(batch));
  RETURN_IF_ERROR(status);
  if (!batch.advantages().empty()) RETURN_IF_ERROR(CheckColumn("advantages", batch.advantages(), n, 1));
  if (!batch.critic_versions().empty() && batch.critic_versions_size() != n) {
    return absl::InvalidArgumentError(absl::StrCat("column 'critic_versions': expected ", n,
                                                   " values, found ", batch.critic_versions_size()));
  }
  return absl::OkStatus();
}

void AppendTransition(const TransitionView& transition, float advantage, std::uint64_t critic_version,
                      TransitionBatch* batch) {
  ForEachColumn([](const ColumnPlace& place, const auto* value,
                   Column* column) { Append(*value, place.width, column); },
                LayoutOf(*batch).columns(), ValuesOf(transition), ColumnsIn(batch));
  batch->add_advantages(advantage);
  batch->add_critic_versions(critic_version);
  batch->set_count(batch->count() + 1);
}

absl::Status Decode(const TransitionBatch& batch, const TransitionLayout& layout, Batch* out) {
  RETURN_IF_ERROR(CheckShape(batch, layout));
  out->Resize(layout, batch.count(), /*with_keys=*/false);
  ForEachColumn([](const Column* column, auto& matrix) { CopyColumn(*column, &matrix); }, ColumnsIn(batch),
                *out);
  return absl::OkStatus();
}

PolicyMessage Encode(const PolicySnapshot& snapshot) {
  PolicyMessage message;
  message.set_version(snapshot.version);
  message.set_updates(snapshot.updates);
  message.set_env(snapshot.spec.env);
  message.set_algorithm(snapshot.spec.algorithm);
  message.set_observation_size(snapshot.spec.observation_size);
  message.set_discrete(snapshot.spec.actions.discrete());
  message.set_action_size(snapshot.spec.actions.size);
  for (const int size : snapshot.spec.hidden_sizes) message.add_hidden_sizes(size);
  message.set_critic_layer_norm(snapshot.spec.critic_layer_norm);
  message.set_ends_offline_phase(snapshot.ends_offline_phase);
  for (const auto& [name, parameters] : snapshot.networks) {
    NamedNetwork* network = message.add_networks();
    network->set_name(name);
    network->mutable_parameters()->Add(parameters.begin(), parameters.end());
  }
  message.set_crc32c(Checksum(snapshot));
  message.set_support_epsilon(snapshot.support_epsilon);
  return message;
}

namespace {

// Sizes beyond any network of ours would only be found by running out of memory.
absl::Status CheckSize(const char* name, std::uint32_t found) {
  constexpr std::uint32_t kMostUnits = 1u << 20;
  if (found >= 1 && found <= kMostUnits) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("policy: ", name, ": expected 1 to ", kMostUnits, ", found ", found));
}

}  // namespace

absl::StatusOr<PolicySnapshot> Decode(const PolicyMessage& message) {
  RETURN_IF_ERROR(CheckSize("observation_size", message.observation_size()));
  RETURN_IF_ERROR(CheckSize("action_size", message.action_size()));
  for (const std::uint32_t size : message.hidden_sizes()) RETURN_IF_ERROR(CheckSize("hidden_sizes", size));
  PolicySnapshot snapshot;
  snapshot.version = message.version();
  snapshot.updates = message.updates();
  snapshot.ends_offline_phase = message.ends_offline_phase();
  snapshot.spec.env = message.env();
  snapshot.spec.algorithm = message.algorithm();
  snapshot.spec.observation_size = static_cast<int>(message.observation_size());
  snapshot.spec.actions = {message.discrete() ? ActionKind::kDiscrete : ActionKind::kContinuous,
                           static_cast<int>(message.action_size())};
  for (const auto size : message.hidden_sizes()) snapshot.spec.hidden_sizes.push_back(static_cast<int>(size));
  snapshot.spec.critic_layer_norm = message.critic_layer_norm();
  snapshot.support_epsilon = message.support_epsilon();
  for (const NamedNetwork& network : message.networks()) {
    snapshot.networks.emplace_back(
        network.name(), std::vector<float>(network.parameters().begin(), network.parameters().end()));
  }
  if (const std::uint32_t found = Checksum(snapshot); found != message.crc32c()) {
    return absl::DataLossError(absl::StrCat("policy version ", message.version(),
                                            " is damaged: expected CRC-32C ", absl::Hex(message.crc32c()),
                                            ", found ", absl::Hex(found)));
  }
  return snapshot;
}

}  // namespace dbr
