// A few transitions that are drawn and relabelled as in the replay server.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/rng.h"
#include "learner/algorithm.h"

namespace dbr {

// Draws with replacement from all transitions, from D+ (advantage >= 0) and from D- (advantage <= 0). Takes
// an update's advantages as the labels of the rows that it drew. A transition that no update drew is in
// neither part. One thread at a time.
class TinyReplay {
 public:
  // `rows` has one column for each transition.
  TinyReplay(Batch rows, std::uint64_t seed)
      : rows_(std::move(rows)), advantages_(static_cast<std::size_t>(rows_.size()), kUnjudged), rng_(seed) {}

  // Makes `updates` updates. Returns the status of the first one that fails, else of the last one.
  absl::Status Train(Algorithm* algorithm, int updates) {
    const BatchNeeds needs = algorithm->needs();
    for (int i = 0; i < updates; ++i) {
      const auto in_plus = [](float advantage) { return advantage >= 0; };
      const auto in_minus = [](float advantage) { return advantage <= 0; };
      Draw(
          needs.uniform, [](float) { return true; }, &uniform_);
      Draw(needs.plus, in_plus, &plus_);
      Draw(needs.minus, in_minus, &minus_);
      if (absl::Status status = algorithm->Update({uniform_, plus_, minus_}); !status.ok()) return status;
      for (std::size_t j = 0; j < uniform_.keys.size(); ++j) {
        advantages_[static_cast<std::size_t>(uniform_.keys[j])] = algorithm->advantages()[j];
      }
    }
    return absl::OkStatus();
  }

 private:
  template <class Predicate>
  void Draw(int count, const Predicate& wanted, Batch* batch) {
    members_.clear();
    for (std::size_t row = 0; row < advantages_.size(); ++row) {
      if (wanted(advantages_[row])) members_.push_back(row);
    }
    const Eigen::Index n = members_.empty() ? 0 : count;
    const auto rows_of = [](const auto& matrix) { return static_cast<int>(matrix.rows()); };
    batch->Resize({rows_of(rows_.observations), rows_of(rows_.actions), rows_of(rows_.masks)}, n,
                  /*with_keys=*/true);
    for (Eigen::Index j = 0; j < n; ++j) {
      const std::size_t row = members_[rng_.Below(static_cast<std::uint32_t>(members_.size()))];
      Copy(static_cast<Eigen::Index>(row), j, batch);
      batch->keys[static_cast<std::size_t>(j)] = row;
    }
  }

  void Copy(Eigen::Index row, Eigen::Index j, Batch* batch) const {
    batch->observations.col(j) = rows_.observations.col(row);
    batch->actions.col(j) = rows_.actions.col(row);
    batch->masks.col(j) = rows_.masks.col(row);
    batch->rewards[j] = rows_.rewards[row];
    batch->discounts[j] = rows_.discounts[row];
    batch->next_observations.col(j) = rows_.next_observations.col(row);
    batch->next_masks.col(j) = rows_.next_masks.col(row);
  }

  const Batch rows_;
  std::vector<float> advantages_;  // [rows]
  std::vector<std::size_t> members_;
  Batch uniform_, plus_, minus_;
  Rng rng_;
};

}  // namespace dbr
