// A few transitions that are drawn and relabelled as in the replay server.
#pragma once

#include <cstdint>
#include <type_traits>
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
    batch->Resize({.observation_width = rows_of(rows_.observations),
                   .action_width = rows_of(rows_.actions),
                   .mask_width = rows_of(rows_.masks),
                   .return_width = rows_.returns.size() > 0 ? 1 : 0,
                   .next_action_width = rows_of(rows_.next_actions)},
                  n, /*with_keys=*/true);
    for (Eigen::Index j = 0; j < n; ++j) {
      const std::size_t row = members_[rng_.Below(static_cast<std::uint32_t>(members_.size()))];
      Copy(static_cast<Eigen::Index>(row), j, batch);
      batch->keys[static_cast<std::size_t>(j)] = row;
    }
  }

  void Copy(Eigen::Index row, Eigen::Index j, Batch* batch) const {
    const auto copy = [row, j](const auto& from, auto& to) {
      if constexpr (std::is_same_v<decltype(to), MatrixX<float>&>) {
        to.col(j) = from.col(row);
      } else if (from.size() > 0) {
        to[j] = from[row];
      }
    };
    ForEachColumn(copy, rows_, *batch);
  }

  const Batch rows_;
  std::vector<float> advantages_;  // [rows]
  std::vector<std::size_t> members_;
  Batch uniform_, plus_, minus_;
  Rng rng_;
};

}  // namespace dbr
