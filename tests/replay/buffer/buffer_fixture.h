// A buffer in memory with short words for what tests do to it.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "replay/buffer/partitioned_buffer.h"
#include "tests/replay/rows.h"

namespace dbr {

inline constexpr absl::Time kNow = absl::InfinitePast();  // a deadline for calls that must not wait
inline constexpr absl::Time kNever =
    absl::InfiniteFuture();  // a deadline for calls that somebody else lets go on

class Buffer : public ::testing::Test {
 protected:
  Buffer() {
    store_options_.env = "connect4";
    store_options_.layout = kSmallLayout;
    store_options_.capacity = 1000;
    buffer_options_.now = [this] { return now_; };
  }

  void Make() {
    auto store = TransitionStore::Open(store_options_);
    ASSERT_TRUE(store.ok()) << store.status();
    auto buffer = PartitionedBuffer::Make(std::move(*store), buffer_options_);
    ASSERT_TRUE(buffer.ok()) << buffer.status();
    buffer_ = std::move(*buffer);
    place_ = *buffer_->OpenWriter({.id = 1, .name = "actor-0"});
  }

  absl::Status Insert(std::uint64_t first, const Rows& rows, absl::Time deadline = kNow) {
    InsertBatch batch;
    batch.first_sequence = first;
    batch.columns = rows.columns();
    return buffer_->Insert(place_, &batch, deadline);
  }
  // Transitions first ... first + count - 1 with one advantage.
  absl::Status Insert(std::uint64_t first, int count, float advantage = kUnjudged,
                      absl::Time deadline = kNow) {
    return Insert(first, Rows(kSmallLayout, first, count, advantage), deadline);
  }

  absl::Status Draw(std::uint32_t uniform, std::uint32_t plus, std::uint32_t minus, bool allow_empty = true,
                    absl::Time deadline = kNow) {
    return buffer_->Draw({.counts = {uniform, plus, minus}, .allow_empty_partitions = allow_empty},
                         {uniform_.columns(), plus_.columns(), minus_.columns()}, deadline, &result_);
  }

  RelabelResult Relabel(std::uint64_t version, const std::vector<std::uint64_t>& keys,
                        const std::vector<float>& advantages) {
    const auto result = buffer_->Relabel(version, keys, advantages);
    EXPECT_TRUE(result.ok()) << result.status();
    return result.ok() ? *result : RelabelResult();
  }

  absl::Time now_ = absl::FromUnixSeconds(1000);
  StoreOptions store_options_;
  BufferOptions buffer_options_;
  std::unique_ptr<PartitionedBuffer> buffer_;
  std::uint32_t place_ = 0;
  DrawResult result_;
  Drawn uniform_{kSmallLayout, 1000}, plus_{kSmallLayout, 1000}, minus_{kSmallLayout, 1000};
};

}  // namespace dbr
