#include "replay/store/transition_store.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class StoreInAFile : public ::testing::Test {
 protected:
  StoreInAFile() {
    options_.path = absl::StrCat(folder_.path(), "/replay.store");
    options_.env = "connect4";
    options_.layout = kSmallLayout;
    options_.capacity = 100;
  }

  std::unique_ptr<TransitionStore> Open() {
    auto store = TransitionStore::Open(options_);
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? std::move(*store) : nullptr;
  }
  std::unique_ptr<TransitionStore> Resume() {
    options_.resume = true;
    return Open();
  }
  absl::Status OpenError() { return TransitionStore::Open(options_).status(); }
  absl::Status ResumeError() {
    options_.resume = true;
    return OpenError();
  }

  // Appends the transitions with keys first, first + 1, ..., evicting where the store is full.
  static void Append(TransitionStore* store, std::uint64_t first, int count, std::uint32_t writer = 0) {
    const Rows rows(kSmallLayout, first, count);
    for (int i = 0; i < count; ++i) {
      if (store->size() == store->capacity()) store->Evict();
      const std::uint64_t sequence = first + static_cast<std::uint64_t>(i);
      store->Append(
          rows.columns().Row(kSmallLayout, i),
          {.sequence = sequence, .critic_version = sequence + 1, .advantage = 0.5f, .writer = writer});
    }
  }

  static void ExpectHolds(const TransitionStore& store, std::uint64_t oldest, std::uint64_t newest) {
    EXPECT_EQ(store.oldest_key(), oldest);
    EXPECT_EQ(store.next_key(), newest + 1);
    for (std::uint64_t key = oldest; key <= newest; ++key) {
      const std::uint32_t slot = store.SlotOf(key);
      const Rows expected(kSmallLayout, key, 1);
      ASSERT_EQ(store.KeyAt(slot), key);
      ASSERT_EQ(store.labels(slot).sequence, key);
      ASSERT_EQ(store.labels(slot).critic_version, key + 1);
      ASSERT_EQ(store.row(slot)[3], expected.observations[3]);
      ASSERT_EQ(store.row(slot)[kSmallLayout.reward_offset()], expected.rewards[0]);
      ASSERT_EQ(store.row(slot)[kSmallLayout.next_mask_offset() + 1], expected.next_masks[1]);
    }
  }

  // Writes `bytes` over the file at `offset`.
  void Damage(std::streamoff offset, const std::string& bytes) {
    std::fstream file(options_.path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(offset);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  TestFolder folder_;
  StoreOptions options_;
};

TEST_F(StoreInAFile, KeepsTheNewestRows) {
  auto store = Open();
  ASSERT_TRUE(store->writers().Open({.id = 7, .name = "actor-0"}).ok());
  Append(store.get(), 1, 250);
  ExpectHolds(*store, 151, 250);
  EXPECT_FALSE(store->Holds(150));
  EXPECT_FALSE(store->Holds(251));
}

TEST_F(StoreInAFile, ResumesRowsCountersWritersAndEpisodes) {
  {
    auto store = Open();
    ASSERT_EQ(store->writers().Open({.id = 7, .name = "actor-0", .source = Source::kSeedBuffer}).value(), 0u);
    Append(store.get(), 1, 130);
    store->writers().record(0).last_sequence = 135;  // five more that were refused
    store->counters().sampled = 1234;
    store->CountEpisode({.episode_return = 2, .score = 0.5f, .length = 9});
    ASSERT_TRUE(store->Sync().ok());
  }
  auto store = Resume();
  ExpectHolds(*store, 31, 130);
  EXPECT_EQ(store->torn(), 0u);
  EXPECT_EQ(store->inserted(), 130u);
  EXPECT_EQ(store->counters().sampled, 1234u);
  EXPECT_EQ(store->counters().episodes, 1u);
  EXPECT_EQ(store->recent_episode(0).length, 9);
  EXPECT_EQ(store->writers().held(0), 100u);
  EXPECT_EQ(store->writers().record(0).last_sequence, 135u);
  EXPECT_EQ(store->writers().Open({.id = 7, .name = "actor-0"}).value(), 0u);
  EXPECT_EQ(store->writers().Open({.id = 8, .name = "actor-1"}).value(), 1u);
}

TEST_F(StoreInAFile, LosesNoCommittedRowByAKill) {
  for (const int rows : {1, 99, 100, 101, 555}) {
    std::filesystem::remove(options_.path);
    options_.resume = false;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      auto store = TransitionStore::Open(options_);
      if (!store.ok() || !(*store)->writers().Open({.id = 7, .name = "actor-0"}).ok()) _exit(1);
      Append(store->get(), 1, rows);
      kill(getpid(), SIGKILL);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    auto store = Resume();
    ASSERT_NE(store, nullptr);
    const std::uint64_t newest = static_cast<std::uint64_t>(rows);
    ExpectHolds(*store, newest > 100 ? newest - 99 : 1, newest);
    EXPECT_EQ(store->torn(), 0u);
    // The table's own last sequence was never written: the rows tell it.
    EXPECT_EQ(store->writers().record(0).last_sequence, newest);
  }
}

TEST_F(StoreInAFile, DropsARowThatWasTorn) {
  std::streamoff newest_key_offset = 0;
  {
    auto store = Open();
    ASSERT_TRUE(store->writers().Open({.id = 7, .name = "actor-0"}).ok());
    Append(store.get(), 1, 150);
    // Where the key of row 150 lies in the file: found by its value, which is nowhere else beside such
    // neighbours.
    std::ifstream file(options_.path, std::ios::binary);
    const std::string contents((std::istreambuf_iterator<char>(file)), {});
    const std::uint64_t pattern[3] = {150, 150, 151};  // key, sequence, critic version
    const auto found = contents.find(std::string(reinterpret_cast<const char*>(pattern), sizeof pattern));
    ASSERT_NE(found, std::string::npos);
    newest_key_offset = static_cast<std::streamoff>(found);
  }
  Damage(newest_key_offset, std::string(8, '\xff'));  // the mark of a row that is being written
  auto store = Resume();
  EXPECT_EQ(store->torn(), 1u);
  ExpectHolds(*store, 51, 149);
  Append(store.get(), 150, 1);  // its place is taken by the next one
  ExpectHolds(*store, 51, 150);
}

TEST_F(StoreInAFile, AnExistingStoreIsNotOverwritten) {
  { Open(); }
  const absl::Status status = OpenError();
  EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(status.ToString(), HasSubstr("--resume"));
}

TEST_F(StoreInAFile, ResumingNothingIsSaid) {
  const absl::Status status = ResumeError();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(status.ToString(), AllOf(HasSubstr(options_.path), HasSubstr("nothing to resume")));
}

TEST_F(StoreInAFile, AStoreInUseIsRefused) {
  auto store = Open();
  const absl::Status status = ResumeError();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.ToString(), HasSubstr("in use"));
}

TEST_F(StoreInAFile, AnotherEnvironmentIsRefused) {
  { Open(); }
  options_.env = "hopper";
  EXPECT_EQ(ResumeError().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(ResumeError().ToString(),
              AllOf(HasSubstr("expected environment 'hopper'"), HasSubstr("found environment 'connect4'")));
}

TEST_F(StoreInAFile, OtherWidthsAreRefused) {
  { Open(); }
  options_.layout.observation_width = 5;
  EXPECT_THAT(ResumeError().ToString(), AllOf(HasSubstr("widths 5/1/3"), HasSubstr("widths 4/1/3")));
}

TEST_F(StoreInAFile, ResumesReturns) {
  options_.layout = kLayoutWithReturns;
  {
    auto store = Open();
    ASSERT_TRUE(store->writers().Open({.id = 7, .name = "actor-0"}).ok());
    const Rows rows(kLayoutWithReturns, 1, 3);
    for (int i = 0; i < 3; ++i) store->Append(rows.columns().Row(kLayoutWithReturns, i), {.sequence = 1});
  }
  auto store = Resume();
  ASSERT_EQ(store->size(), 3u);
  for (std::uint64_t key = 1; key <= 3; ++key) {
    const Rows expected(kLayoutWithReturns, key, 1);
    std::vector<float> flat;
    expected.AppendFlat(0, &flat);
    const float* const row = store->row(store->SlotOf(key));
    EXPECT_EQ(std::vector<float>(row, row + kLayoutWithReturns.stride()), flat);
    EXPECT_EQ(row[kLayoutWithReturns.return_offset()], expected.returns[0]);
  }
}

TEST_F(StoreInAFile, AStoreWithoutTheReturnsThatARunNeedsIsRefusedAndTheOtherWayRound) {
  { Open(); }
  options_.layout = kLayoutWithReturns;
  const absl::Status lacks = ResumeError();
  EXPECT_EQ(lacks.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(lacks.ToString(), AllOf(HasSubstr("with returns"), HasSubstr("found environment 'connect4', "
                                                                           "widths 4/1/3 "
                                                                           "(observation/action/mask), "
                                                                           "without returns")));
  std::filesystem::remove(options_.path);
  options_.resume = false;
  { Open(); }
  options_.layout = kSmallLayout;
  EXPECT_THAT(ResumeError().ToString(),
              HasSubstr("(observation/action/mask), with returns, without next actions, "
                        "capacity 100. "));
}

TEST_F(StoreInAFile, AStoreWithoutTheNextActionsThatARunNeedsIsRefused) {
  { Open(); }
  options_.layout.next_action_width = options_.layout.action_width;
  EXPECT_THAT(ResumeError().ToString(),
              AllOf(HasSubstr("with next actions"), HasSubstr("found environment"),
                    HasSubstr("without returns, without next actions, capacity 100. ")));
}

TEST_F(StoreInAFile, AnotherCapacityIsRefused) {
  { Open(); }
  options_.capacity = 200;
  EXPECT_THAT(ResumeError().ToString(), AllOf(HasSubstr("capacity 200"), HasSubstr("capacity 100")));
}

TEST_F(StoreInAFile, ATruncatedFileIsRefused) {
  { Open(); }
  const auto bytes = std::filesystem::file_size(options_.path);
  for (const std::uintmax_t length :
       {bytes - 1, std::uintmax_t{5000}, std::uintmax_t{20}, std::uintmax_t{0}}) {
    std::filesystem::resize_file(options_.path, length);
    EXPECT_EQ(ResumeError().code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(ResumeError().ToString(), AllOf(HasSubstr(absl::StrCat("expected ", bytes, " bytes")),
                                                HasSubstr(absl::StrCat("found ", length))));
  }
}

TEST_F(StoreInAFile, ADamagedHeaderIsRefused) {
  { Open(); }
  Damage(12, "\x77");
  EXPECT_EQ(ResumeError().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(ResumeError().ToString(), HasSubstr("damaged"));
  Damage(0, "SOMETHING ELSE");
  EXPECT_THAT(ResumeError().ToString(), HasSubstr("no replay store"));
}

TEST_F(StoreInAFile, SurvivesDamageBehindTheHeader) {
  {
    auto store = Open();
    ASSERT_TRUE(store->writers().Open({.id = 7, .name = "actor-0"}).ok());
    Append(store.get(), 1, 150);
  }
  const auto bytes = static_cast<std::streamoff>(std::filesystem::file_size(options_.path));
  Damage(4096, std::string(static_cast<std::size_t>(bytes - 4096), '\xab'));
  EXPECT_EQ(ResumeError().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(ResumeError().ToString(), HasSubstr("record of the seed buffer is damaged"));
  Damage(4096, std::string(1024, '\0'));  // the counters and that record
  auto store = Resume();
  ASSERT_NE(store, nullptr);
  EXPECT_LE(store->size(), 100u);
}

TEST_F(StoreInAFile, AFullDiskIsAnErrorAndLeavesNothing) {
  // A limit on file sizes stands for the disk: the reservation fails in the same way.
  signal(SIGXFSZ, SIG_IGN);
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{1 << 16, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const absl::Status status = OpenError();
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_THAT(status.ToString(), HasSubstr("cannot reserve"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

TEST_F(StoreInAFile, AMissingFolderIsSaid) {
  options_.path = absl::StrCat(folder_.path(), "/nowhere/replay.store");
  EXPECT_EQ(OpenError().code(), absl::StatusCode::kNotFound);
}

TEST(StoreInMemory, RefusesACapacityLargerThanTheMachine) {
  StoreOptions options;
  options.layout = kSmallLayout;
  options.capacity = 1000000;
  options.memory_bytes = 1000000;
  const absl::Status status = TransitionStore::Open(options).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.ToString(), AllOf(HasSubstr("replay.capacity"), HasSubstr("1000000 transitions"),
                                       HasSubstr("this machine has 1000000")));
  options.capacity = ~std::uint64_t{0};
  EXPECT_EQ(TransitionStore::Open(options).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(StoreInMemory, TheSmallerOfCapacityAndBudgetHolds) {
  StoreOptions options;
  options.layout = kSmallLayout;
  options.capacity = 1000;
  options.byte_budget = 100000;
  const auto budgeted = TransitionStore::Open(options);
  ASSERT_TRUE(budgeted.ok());
  EXPECT_LT((*budgeted)->capacity(), 1000u);
  EXPECT_GT((*budgeted)->capacity(), 400u);
  options.capacity = 10;
  EXPECT_EQ((*TransitionStore::Open(options))->capacity(), 10u);
  options.byte_budget = 10;
  EXPECT_THAT(TransitionStore::Open(options).status().ToString(), HasSubstr("replay.byte_budget"));
}

}  // namespace
}  // namespace dbr
