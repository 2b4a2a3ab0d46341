// The buffer against a slow and plain model of it, and under many threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <thread>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/rng.h"
#include "replay/buffer/partitioned_buffer.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

constexpr std::uint64_t kCapacity = 50;
constexpr int kWriters = 3;
constexpr int kSeedWriter = 0x5eed - 100;  // in the model; the buffer's id for a writer is 100 more

// A model of what the buffer promises, as simple as it can be.
struct Model {
  struct Row {
    std::uint64_t key;
    int writer;
    std::uint64_t value;  // which transition it is
    float advantage;
    std::uint64_t version;
  };

  void Insert(int writer, std::uint64_t sequence, std::uint64_t value, float advantage,
              std::uint64_t version) {
    if (sequence <= last_sequence[writer]) {
      ++duplicates;
      return;
    }
    last_sequence[writer] = sequence;
    ++inserted;
    rows.push_back({++newest_key, writer, value, advantage, version});
    if (rows.size() <= kCapacity) return;
    rows.erase(std::find_if(rows.begin(), rows.end(), [](const Row& r) { return r.writer != kSeedWriter; }));
  }
  void InsertSeedBuffer(std::uint64_t value) {
    rows.push_back({++newest_key, kSeedWriter, value, kUnjudged, 0});
  }
  void Relabel(std::uint64_t key, float advantage, std::uint64_t version) {
    const auto row = std::find_if(rows.begin(), rows.end(), [key](const Row& r) { return r.key == key; });
    if (row == rows.end()) {
      ++relabel_evicted;
    } else if (row->version > version) {
      ++relabel_stale;
    } else {
      ++relabelled;
      row->advantage = cumulative ? std::fmax(std::fmax(row->advantage, 0.0f), 0.0f) + advantage : advantage;
      row->version = version;
    }
  }
  bool InPart(const Row& row, int part) const {
    return part == kAll || (part == kPlus && row.advantage >= 0) ||
           (part == kMinus && row.advantage <= -margin) ||
           (part == kUnjudgedPart && std::isnan(row.advantage));
  }
  std::uint64_t Size(int part) const { return SeedBuffer(part) + Others(part); }
  std::uint64_t SeedBuffer(int part) const { return Count(part, /*of_seed_buffer=*/true); }
  std::uint64_t Others(int part) const { return Count(part, /*of_seed_buffer=*/false); }
  std::uint64_t Count(int part, bool of_seed_buffer) const {
    return static_cast<std::uint64_t>(std::count_if(rows.begin(), rows.end(), [&](const Row& row) {
      return InPart(row, part) && (row.writer == kSeedWriter) == of_seed_buffer;
    }));
  }
  const Row* Find(std::uint64_t key) const {
    const auto row = std::find_if(rows.begin(), rows.end(), [key](const Row& r) { return r.key == key; });
    return row == rows.end() ? nullptr : &*row;
  }

  bool cumulative = false;
  float margin = 0;  // of D-
  std::deque<Row> rows;
  std::map<int, std::uint64_t> last_sequence;
  std::uint64_t newest_key = 0, inserted = 0, duplicates = 0, relabelled = 0, relabel_evicted = 0,
                relabel_stale = 0;
};

// Parameters: random seed, cumulative advantages, the margin of D-, rows of a pinned seed buffer.
class BufferAgainstModel : public ::testing::TestWithParam<std::tuple<int, bool, float, int>> {
 protected:
  BufferAgainstModel() : rng_(static_cast<std::uint64_t>(std::get<0>(GetParam()))) {
    model_.cumulative = std::get<1>(GetParam());
    model_.margin = std::get<2>(GetParam());
    store_options_.path = absl::StrCat(folder_.path(), "/replay.store");
    store_options_.env = "connect4";
    store_options_.layout = kSmallLayout;
    store_options_.capacity = kCapacity;
    Reopen();
    InsertSeedBuffer(std::get<3>(GetParam()));
  }

  void InsertSeedBuffer(int count) {
    if (count == 0) return;
    const Rows rows(kSmallLayout, next_value_, count);
    std::vector<float> flat;
    for (int i = 0; i < count; ++i) {
      rows.AppendFlat(i, &flat);
      model_.InsertSeedBuffer(next_value_++);
    }
    ASSERT_TRUE(buffer_->InsertSeedBuffer(flat).ok());
    ASSERT_TRUE(buffer_->CompleteSeedBuffer({}, /*pin=*/true).ok());
  }

  void Reopen() {
    buffer_.reset();
    auto store = TransitionStore::Open(store_options_);
    ASSERT_TRUE(store.ok()) << store.status();
    BufferOptions options;
    options.cumulative_advantage = model_.cumulative;
    options.minus_margin = model_.margin;
    options.seed_buffer_share = share_;
    options.seed = rng_();
    auto buffer = PartitionedBuffer::Make(std::move(*store), options);
    ASSERT_TRUE(buffer.ok()) << buffer.status();
    buffer_ = std::move(*buffer);
    for (int writer = 0; writer < kWriters; ++writer) {
      places_[writer] = *buffer_->OpenWriter({.id = 100u + static_cast<std::uint64_t>(writer), .name = "w"});
    }
    store_options_.resume = true;
  }

  // Draws one of few values, so that zeros, signs and equal ones all come up.
  float RandomAdvantage() { return static_cast<float>(rng_.Below(5)) - 2; }

  void InsertSome() {
    const int writer = static_cast<int>(rng_.Below(kWriters));
    const int count = 1 + static_cast<int>(rng_.Below(rng_.Below(20) == 0 ? 2 * kCapacity : 6));
    const std::uint64_t last = model_.last_sequence[writer];
    const std::uint64_t back = std::min<std::uint64_t>(last, rng_.Below(4));
    InsertBatch batch;
    batch.first_sequence = last + 1 - back + (rng_.Below(10) == 0 ? rng_.Below(5) : 0);
    Rows rows(kSmallLayout, next_value_, count);
    for (int i = 0; i < count; ++i) {
      if (rng_.Below(3) > 0) rows.advantages[i] = RandomAdvantage();
      rows.critic_versions[i] = std::isnan(rows.advantages[i]) ? 0 : rng_.Below(10);
      model_.Insert(writer, batch.first_sequence + static_cast<std::uint64_t>(i),
                    next_value_ + static_cast<std::uint64_t>(i), rows.advantages[i], rows.critic_versions[i]);
    }
    next_value_ += static_cast<std::uint64_t>(count);
    batch.columns = rows.columns();
    ASSERT_TRUE(buffer_->Insert(places_[writer], &batch, absl::InfinitePast()).ok());
    EXPECT_EQ(buffer_->Progress(places_[writer]).last_sequence, model_.last_sequence[writer]);
  }

  void RelabelSome() {
    const int count = static_cast<int>(rng_.Below(8));
    const std::uint64_t version = rng_.Below(20);
    std::vector<std::uint64_t> keys;
    std::vector<float> advantages;
    for (int i = 0; i < count; ++i) {
      keys.push_back(rng_.Below(static_cast<std::uint32_t>(model_.newest_key) + 3));
      advantages.push_back(RandomAdvantage());
      model_.Relabel(keys.back(), advantages.back(), version);
    }
    ASSERT_TRUE(buffer_->Relabel(version, keys, advantages).ok());
  }

  void DrawSome() {
    if (model_.rows.empty()) return;
    constexpr std::uint32_t kDraws = 20;
    Drawn parts[] = {{kSmallLayout, kDraws}, {kSmallLayout, kDraws}, {kSmallLayout, kDraws}};
    DrawResult result;
    ASSERT_TRUE(buffer_
                    ->Draw({.counts = {kDraws, kDraws, kDraws}, .allow_empty_partitions = true},
                           {parts[0].columns(), parts[1].columns(), parts[2].columns()}, absl::InfinitePast(),
                           &result)
                    .ok());
    for (int part = 0; part < kDrawnParts; ++part) {
      ASSERT_EQ(result.drawn[part], model_.Size(part) > 0 ? kDraws : 0);
      parts[part].ExpectWhole(result.drawn[part]);
      double of_seed_buffer = 0;
      for (std::uint32_t i = 0; i < result.drawn[part]; ++i) {
        const Model::Row* row = model_.Find(parts[part].keys[i]);
        ASSERT_NE(row, nullptr);
        ASSERT_TRUE(model_.InPart(*row, part));
        ASSERT_EQ(parts[part].rewards[i], Rows::Value(row->value));
        of_seed_buffer += row->writer == kSeedWriter;
      }
      if (model_.SeedBuffer(part) == 0 || model_.Others(part) == 0) continue;
      const double moved = std::min(1.0, static_cast<double>(model_.inserted) / 400);
      ASSERT_LT(std::abs(of_seed_buffer - kDraws * (0.9 - 0.6 * moved)), 1) << part;
    }
  }

  void Compare() {
    const BufferStats stats = buffer_->Stats();
    ASSERT_EQ(stats.total, model_.Size(kAll));
    ASSERT_EQ(stats.plus, model_.Size(kPlus));
    ASSERT_EQ(stats.minus, model_.Size(kMinus));
    ASSERT_EQ(stats.unjudged, model_.Size(kUnjudgedPart));
    ASSERT_EQ(stats.seed_buffer, model_.SeedBuffer(kAll));
    ASSERT_EQ(stats.seed_buffer_plus, model_.SeedBuffer(kPlus));
    ASSERT_EQ(stats.seed_buffer_minus, model_.SeedBuffer(kMinus));
    ASSERT_EQ(stats.inserted, model_.inserted);
    ASSERT_EQ(stats.evicted, model_.newest_key - model_.rows.size());
    ASSERT_EQ(stats.counters.duplicates, model_.duplicates);
    ASSERT_EQ(stats.counters.relabelled, model_.relabelled);
    ASSERT_EQ(stats.counters.relabel_evicted, model_.relabel_evicted);
    ASSERT_EQ(stats.counters.relabel_stale, model_.relabel_stale);
    for (const WriterSummary& writer : stats.writers) {
      ASSERT_EQ(writer.held,
                std::count_if(model_.rows.begin(), model_.rows.end(), [&](const Model::Row& row) {
                  return row.writer == static_cast<int>(writer.identity.id - 100);
                }));
    }
  }

  const SeedBufferShare share_ = {.first = 0.9, .final = 0.3, .decay_rows = 400};
  Rng rng_;
  Model model_;
  TestFolder folder_;
  StoreOptions store_options_;
  std::unique_ptr<PartitionedBuffer> buffer_;
  std::uint32_t places_[kWriters] = {};
  std::uint64_t next_value_ = 1;
};

TEST_P(BufferAgainstModel, AgreesAfterEveryStep) {
  for (int step = 0; step < 1500 && !HasFatalFailure(); ++step) {
    switch (rng_.Below(3)) {
      case 0:
        InsertSome();
        break;
      case 1:
        RelabelSome();
        break;
      default:
        DrawSome();
    }
    if (rng_.Below(100) == 0) Reopen();
    Compare();
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, BufferAgainstModel,
                         ::testing::Combine(::testing::Values(1, 2, 3), ::testing::Bool(),
                                            ::testing::Values(0.0f, 1.0f), ::testing::Values(0, 20)));

// Writers, a learner that draws and relabels, and a watcher, all at once, with the limiter between them.
TEST(BufferUnderThreads, KeepsItsPromises) {
  constexpr int kMessages = 300, kRowsPerMessage = 20, kThreads = 3, kDraws = 60;
  StoreOptions store_options;
  store_options.layout = kSmallLayout;
  store_options.capacity = 500;
  BufferOptions options;
  options.limiter = {.samples_per_insert = 1, .tolerance = 200, .min_size = 100};
  auto buffer = *PartitionedBuffer::Make(*TransitionStore::Open(store_options), options);

  std::vector<std::thread> writers;
  for (int w = 0; w < kThreads; ++w) {
    writers.emplace_back([&buffer, w] {
      const std::uint32_t place = *buffer->OpenWriter({.id = static_cast<std::uint64_t>(w) + 1, .name = "w"});
      for (int message = 0; message < kMessages; ++message) {
        const std::uint64_t first = static_cast<std::uint64_t>(message) * kRowsPerMessage + 1;
        const Rows rows(kSmallLayout, first, kRowsPerMessage, static_cast<float>(message % 3 - 1));
        InsertBatch batch;
        batch.first_sequence = first;
        batch.columns = rows.columns();
        ASSERT_TRUE(buffer->Insert(place, &batch, absl::InfiniteFuture()).ok());
        EXPECT_EQ(buffer->Progress(place).last_sequence, first + kRowsPerMessage - 1);
      }
      buffer->CloseWriter(place);
    });
  }
  std::thread learner([&buffer] {
    Drawn uniform(kSmallLayout, kDraws), plus(kSmallLayout, kDraws), minus(kSmallLayout, kDraws);
    for (std::uint64_t version = 1;; ++version) {
      DrawResult result;
      const absl::Status status =
          buffer->Draw({.counts = {kDraws, kDraws, kDraws}, .allow_empty_partitions = true},
                       {uniform.columns(), plus.columns(), minus.columns()}, absl::InfiniteFuture(), &result);
      if (!status.ok()) {
        EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
        return;
      }
      uniform.ExpectWhole(kDraws);
      plus.ExpectWhole(result.drawn[kPlus]);
      minus.ExpectWhole(result.drawn[kMinus]);
      std::vector<float> advantages(kDraws, version % 2 == 0 ? 1.0f : -1.0f);
      ASSERT_TRUE(buffer->Relabel(version, uniform.keys, advantages).ok());
    }
  });
  std::atomic<bool> done = false;
  std::thread watcher([&buffer, &done] {
    while (!done) {
      const BufferStats stats = buffer->Stats();
      EXPECT_GE(stats.plus + stats.minus + stats.unjudged, stats.total);
      EXPECT_EQ(stats.inserted, stats.total + stats.evicted);
    }
  });
  for (std::thread& writer : writers) writer.join();
  buffer->Close();
  learner.join();
  done = true;
  watcher.join();
  const BufferStats stats = buffer->Stats();
  EXPECT_EQ(stats.inserted, static_cast<std::uint64_t>(kThreads) * kMessages * kRowsPerMessage);
  EXPECT_EQ(stats.total, 500u);
  EXPECT_EQ(stats.counters.duplicates, 0u);
  std::uint64_t held = 0;
  for (const WriterSummary& writer : stats.writers) held += writer.held;
  EXPECT_EQ(held, stats.total);
}

}  // namespace
}  // namespace dbr
