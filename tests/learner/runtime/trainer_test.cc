// Tests the learner with a real replay server: updates, advantages written back, checkpoints, resumed runs.
#include "learner/runtime/trainer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <thread>

#include "absl/time/clock.h"
#include "learner/algorithms/registry.h"
#include "learner/runtime/policy_service.h"
#include "proto/config/config_file.h"
#include "replay/client/writer.h"
#include "replay/service/replay_server.h"
#include "tests/learner/algorithms/batches.h"
#include "tests/replay/rows.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr std::uint64_t kUpdates = 30;

class TrainerTest : public testing::Test {
 protected:
  void SetUp() override {
    Config config;
    config.mutable_replay()->set_capacity(1000);
    config.mutable_replay()->set_min_size(64);
    StartReplay(OptionsFrom(config, Layout()));
    auto metrics = MetricsSink::Open(RunFolder{folder_.path()}, absl::Seconds(1), absl::Now());
    ASSERT_TRUE(metrics.ok()) << metrics.status();
    metrics_ = std::move(metrics).value();
  }

  // Starts a replay server in the place of the one before.
  void StartReplay(ReplayServerOptions options) {
    replay_.reset();
    options.server.address = "unix:" + folder_.path() + "/replay.sock";
    auto replay = ReplayServer::Start(options);
    ASSERT_TRUE(replay.ok()) << replay.status();
    replay_ = std::move(replay).value();
  }

  static TransitionLayout Layout() { return {5, 1, 3}; }

  // Inserts transitions without an advantage.
  void Insert(int count) {
    TransitionWriter writer({.address = replay_->address(), .name = "test", .layout = Layout()});
    const Batch batch = RandomBatch<float>(SmallSpec(), count, rng_);
    const auto column = [](const MatrixX<float>& m, int j) {
      return absl::Span<const float>(m.data() + m.rows() * j, static_cast<std::size_t>(m.rows()));
    };
    for (int j = 0; j < count; ++j) {
      const TransitionView view{column(batch.observations, j),
                                column(batch.actions, j),
                                column(batch.masks, j),
                                batch.rewards[j],
                                batch.discounts[j],
                                column(batch.next_observations, j),
                                column(batch.next_masks, j)};
      ASSERT_TRUE(writer.Append(view, kUnjudged, 0, std::nullopt, absl::Seconds(10)).ok());
    }
    ASSERT_TRUE(writer.Flush(absl::Seconds(10)).ok());
  }

  std::unique_ptr<Trainer> MakeTrainer(std::uint64_t max_updates) {
    return MakeTrainer(max_updates, MakeAlgorithm(SmallSpec()).value());
  }
  std::unique_ptr<Trainer> MakeTrainer(std::uint64_t max_updates, std::unique_ptr<Algorithm> algorithm,
                                       std::uint32_t push_every = 10) {
    LearnerConfig config;
    config.set_max_updates(max_updates);
    config.set_push_every(push_every);
    config.set_metrics_every(10);
    config.set_keep_policy_every(keep_policy_every_);
    TrainerParts parts{.algorithm = std::move(algorithm),
                       .matrix_products = "a library, float32",
                       .policy_service = &service_,
                       .metrics = metrics_.get(),
                       .saver = &saver_,
                       .prefetcher = nullptr,
                       .relabeller = nullptr,
                       .finetune = &finetune_};
    const BatchNeeds needs = parts.algorithm->needs();
    draws_ = std::make_unique<ReplayClient>(replay_->address());
    labels_ = std::make_unique<ReplayClient>(replay_->address());
    parts.relabeller = std::make_unique<Relabeller>(labels_.get());
    parts.prefetcher = std::make_unique<Prefetcher>(
        draws_.get(),
        PrefetcherOptions{.counts = {needs.uniform, needs.plus, needs.minus}, .layout = Layout()});
    return std::make_unique<Trainer>(config, std::move(parts));
  }

  // The policy file at `path`, which another thread writes.
  static absl::StatusOr<PolicySnapshot> AwaitPolicy(const std::string& path) {
    const absl::Time deadline = absl::Now() + absl::Seconds(60);
    while (!std::filesystem::exists(path) && absl::Now() < deadline) std::this_thread::yield();
    return LoadPolicy(path);
  }

  // Runs until the service says that this run has finished, and then stops.
  void RunToTheEnd(Trainer* trainer) {
    service_.SetStatus(LearnerStatus());  // clears the end of an earlier run
    std::thread thread([&] { EXPECT_TRUE(trainer->Run().ok()); });
    const absl::Time deadline = absl::Now() + absl::Seconds(60);
    const LearnerStatusRequest request;
    LearnerStatus status;
    while (!status.finished() && absl::Now() < deadline) {
      service_.Status(nullptr, &request, &status);
      std::this_thread::yield();
    }
    EXPECT_TRUE(status.finished());
    trainer->Stop();
    thread.join();
  }

  std::uint64_t keep_policy_every_ = 0;
  Rng rng_{4};
  TempDir folder_;
  std::unique_ptr<ReplayServer> replay_;
  std::unique_ptr<MetricsSink> metrics_;
  Finetune finetune_{Config()};
  PolicyService service_{[](const EvaluationReport&) {}};
  Saver saver_{RunFolder{folder_.path()}, 3};
  std::unique_ptr<ReplayClient> draws_, labels_;
};

TEST_F(TrainerTest, TrainsWritesAdvantagesBackAndSaves) {
  Insert(100);
  const auto trainer = MakeTrainer(kUpdates);
  RunToTheEnd(trainer.get());
  EXPECT_EQ(trainer->updates(), kUpdates);
  ReplayClient client(replay_->address());
  const auto stats = client.Stats(absl::Seconds(10));
  ASSERT_TRUE(stats.ok()) << stats.status();
  EXPECT_GT(stats->relabelled(), 0u);
  EXPECT_GT(stats->plus() + stats->minus(), 0u);
  const auto policy = LoadPolicy(RunFolder{folder_.path()}.latest_policy());
  ASSERT_TRUE(policy.ok()) << policy.status();
  EXPECT_EQ(policy->updates, kUpdates);
}

TEST_F(TrainerTest, TellsWhatMakesItsMatrixProducts) {
  Insert(100);
  RunToTheEnd(MakeTrainer(kUpdates).get());
  const LearnerStatusRequest request;
  LearnerStatus status;
  service_.Status(nullptr, &request, &status);
  EXPECT_EQ(status.matrix_products(), "a library, float32");
}

// Follows the advantage ARM_CUMULATIVE from the config to the labels in the store: A_T = max(A_{T-1}, 0) + (Q
// - V), for either sign, each time that a transition is judged.
TEST_F(TrainerTest, CumulativeAdvantagesAddUpInTheReplay) {
  const auto config =
      ParseConfig("algorithm { dbr { advantage: ARM_CUMULATIVE } } replay { capacity: 1000 min_size: 64 }");
  ASSERT_TRUE(config.ok()) << config.status();
  ReplayServerOptions options = OptionsFrom(*config, Layout());
  options.store.path = folder_ / "replay.store";
  StartReplay(options);
  Insert(100);
  AlgorithmSpec spec = SmallSpec();
  *spec.config.mutable_dbr() = config->algorithm().dbr();
  const auto algorithm = MakeAlgorithm(spec).value();
  const BatchNeeds needs = algorithm->needs();
  ReplayClient client(replay_->address());
  std::map<std::uint64_t, float> expected;
  int above_newest = 0;
  for (std::uint64_t version = 1; version <= kUpdates; ++version) {
    DrawnBatches drawn;
    ASSERT_TRUE(
        client.Sample({needs.uniform, needs.plus, needs.minus}, Layout(), absl::Seconds(10), &drawn).ok());
    ASSERT_TRUE(algorithm->Update({drawn.uniform, drawn.plus, drawn.minus}).ok());
    const absl::Span<const float> advantages = algorithm->advantages();
    ASSERT_TRUE(client.Relabel(version, drawn.uniform.keys, advantages, absl::Seconds(10)).ok());
    for (std::size_t i = 0; i < advantages.size(); ++i) {
      float& sum = expected.try_emplace(drawn.uniform.keys[i], 0.0f).first->second;
      sum = std::max(sum, 0.0f) + advantages[i];
      above_newest += sum > advantages[i];
    }
  }
  EXPECT_GT(above_newest, 100) << "else this could not be told from ARM";
  replay_.reset();
  options.store.resume = true;
  const auto store = TransitionStore::Open(options.store);
  ASSERT_TRUE(store.ok()) << store.status();
  ASSERT_GT(expected.size(), 90u);
  for (const auto& [key, advantage] : expected) {
    EXPECT_EQ((*store)->labels((*store)->SlotOf(key)).advantage, advantage) << key;
  }
}

TEST_F(TrainerTest, ContinuesFromItsCheckpoint) {
  Insert(100);
  RunToTheEnd(MakeTrainer(kUpdates).get());
  const auto saved = Checkpoints(RunFolder{folder_.path()}.checkpoints(), 3).LoadNewest();
  ASSERT_TRUE(saved.ok()) << saved.status();
  auto same = MakeTrainer(kUpdates);
  ASSERT_TRUE(same->Load(saved->file).ok());
  RunToTheEnd(same.get());  // it makes no update, and saves
  same.reset();             // it ends before the server that it draws from
  const auto saved_again = Checkpoints(RunFolder{folder_.path()}.checkpoints(), 3).LoadNewest();
  ASSERT_TRUE(saved_again.ok()) << saved_again.status();
  EXPECT_NE(saved_again->file.metadata, saved->file.metadata) << "of the same save: versions must go on";
  EXPECT_EQ(saved_again->file.tensors, saved->file.tensors);
  const auto policy_before = LoadPolicy(RunFolder{folder_.path()}.latest_policy());
  const auto again = MakeTrainer(2 * kUpdates);
  ASSERT_TRUE(again->Load(saved->file).ok());
  EXPECT_EQ(again->updates(), kUpdates);
  RunToTheEnd(again.get());
  EXPECT_EQ(again->updates(), 2 * kUpdates);
  const auto policy_after = LoadPolicy(RunFolder{folder_.path()}.latest_policy());
  ASSERT_TRUE(policy_before.ok() && policy_after.ok());
  EXPECT_GT(policy_after->version, policy_before->version);
}

TEST_F(TrainerTest, KeepsThePoliciesThatAreToBeKept) {
  Insert(100);
  keep_policy_every_ = kUpdates / 4;
  RunToTheEnd(MakeTrainer(kUpdates).get());
  const RunFolder folder{folder_.path()};
  std::set<std::vector<float>> different;
  for (std::uint64_t updates = keep_policy_every_; updates <= kUpdates; updates += keep_policy_every_) {
    const auto policy = AwaitPolicy(folder.kept_policy(updates));
    ASSERT_TRUE(policy.ok()) << policy.status();
    EXPECT_EQ(policy->updates, updates);
    different.insert(*policy->Find(kPolicyNetwork));
  }
  EXPECT_EQ(different.size(), 4u);
  EXPECT_FALSE(std::filesystem::exists(folder.kept_policy(keep_policy_every_ + 1)));
}

TEST_F(TrainerTest, KeepsNoPolicyButTheNewestUnlessItIsToldTo) {
  Insert(100);
  RunToTheEnd(MakeTrainer(kUpdates).get());
  int files = 0;
  for ([[maybe_unused]] const auto& file :
       std::filesystem::directory_iterator(RunFolder{folder_.path()}.policies())) {
    ++files;
  }
  EXPECT_EQ(files, 1);
}

TEST(SaverTest, WhatComesLateDoesNotTakeThePlaceOfWhatIsNewer) {
  const TempDir folder;
  Saver saver(RunFolder{folder.path()}, 3);
  Checkpoint checkpoint;
  MakeAlgorithm(SmallSpec()).value()->ExportPolicy(&checkpoint.policy);
  for (const std::uint64_t updates : {20, 10, 30}) {
    checkpoint.updates = checkpoint.policy.updates = updates;
    ASSERT_TRUE(saver.SaveNow(checkpoint).ok());
    EXPECT_EQ(LoadPolicy(RunFolder{folder.path()}.latest_policy())->updates,
              std::max<std::uint64_t>(20, updates));
  }
}

TEST_F(TrainerTest, VersionsGoOnAfterTheNewestThatTheReplayHasSeen) {
  Insert(100);
  const auto trainer = MakeTrainer(kUpdates);
  trainer->StartVersionsAfter(1000);
  RunToTheEnd(trainer.get());
  const auto policy = LoadPolicy(RunFolder{folder_.path()}.latest_policy());
  ASSERT_TRUE(policy.ok()) << policy.status();
  EXPECT_GT(policy->version, 1000u);
}

TEST_F(TrainerTest, StopsWhileTheRateLimiterHoldsTheFirstDraw) {
  Insert(10);  // below min_size
  const auto trainer = MakeTrainer(kUpdates);
  std::thread thread([&] { EXPECT_TRUE(trainer->Run().ok()); });
  trainer->Stop();
  thread.join();
  EXPECT_EQ(trainer->updates(), 0u);
}

// The launcher starts the actors when it hears that the offline updates are made.
TEST_F(TrainerTest, TellsHowFarItIsThoughItPushesSeldom) {
  Insert(100);
  const auto trainer =
      MakeTrainer(/*max_updates=*/0, MakeAlgorithm(SmallSpec()).value(), /*push_every=*/1'000'000'000);
  std::thread thread([&] { EXPECT_TRUE(trainer->Run().ok()); });
  const LearnerStatusRequest request;
  LearnerStatus status;
  for (const absl::Time deadline = absl::Now() + absl::Seconds(60);
       status.updates() == 0 && absl::Now() < deadline;) {
    service_.Status(nullptr, &request, &status);
    std::this_thread::yield();
  }
  EXPECT_GT(status.updates(), 0u);
  trainer->Stop();
  thread.join();
}

// What stands there may be worth more: a run that is resumed without its checkpoints and stopped at once.
TEST_F(TrainerTest, SavesNothingWhereItHasMadeNoUpdate) {
  const auto trainer = MakeTrainer(/*max_updates=*/0);
  trainer->Stop();
  EXPECT_TRUE(trainer->Run().ok());
  EXPECT_FALSE(std::filesystem::exists(RunFolder{folder_.path()}.latest_policy()));
  EXPECT_TRUE(
      absl::IsNotFound(Checkpoints(RunFolder{folder_.path()}.checkpoints(), 3).LoadNewest().status()));
}

TEST_F(TrainerTest, SavesWhatIsSoundWhereTheReplayIsGoneForGood) {
  Insert(100);
  auto trainer = MakeTrainer(/*max_updates=*/0);
  absl::Status ended;
  std::thread thread([&] { ended = trainer->Run(); });
  LearnerStatus status;
  while (status.updates() == 0) {
    LearnerStatusRequest request;
    service_.Status(nullptr, &request, &status);
    std::this_thread::yield();
  }
  // A server of other widths takes its place: no other try can mend that.
  Config config;
  config.mutable_replay()->set_capacity(1000);
  config.mutable_replay()->set_min_size(64);
  constexpr TransitionLayout kOther{6, 1, 3};
  StartReplay(OptionsFrom(config, kOther));
  TransitionWriter writer({.address = replay_->address(), .name = "other", .layout = kOther});
  const Rows rows(kOther, 1, 100);
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(
        writer.Append(rows.columns().Row(kOther, i), kUnjudged, 0, std::nullopt, absl::Seconds(10)).ok());
  }
  thread.join();
  EXPECT_TRUE(absl::IsInvalidArgument(ended)) << ended;
  EXPECT_GT(trainer->updates(), 0u);
  const auto policy = LoadPolicy(RunFolder{folder_.path()}.latest_policy());
  ASSERT_TRUE(policy.ok()) << policy.status();
  EXPECT_EQ(policy->updates, trainer->updates());
  const auto saved = Checkpoints(RunFolder{folder_.path()}.checkpoints(), 3).LoadNewest();
  ASSERT_TRUE(saved.ok()) << saved.status();
  trainer.reset();  // it ends before the clients that it uses
  EXPECT_TRUE(MakeTrainer(0)->Load(saved->file).ok());
}

// An algorithm whose second update fails. Its state is worthless from then on, whatever the code of the
// error.
class Breaking final : public Algorithm {
 public:
  Breaking(std::unique_ptr<Algorithm> sound, absl::Status error)
      : sound_(std::move(sound)), error_(std::move(error)) {}

  absl::Status Update(const UpdateBatches& batches) override {
    return updates_++ == 0 ? sound_->Update(batches) : error_;
  }
  BatchNeeds needs() const override { return sound_->needs(); }
  absl::Span<const float> advantages() const override { return sound_->advantages(); }
  absl::Span<const UpdateMetric> metrics() const override { return sound_->metrics(); }
  double UpdateFlops() const override { return sound_->UpdateFlops(); }
  void ExportPolicy(PolicySnapshot* snapshot) const override { sound_->ExportPolicy(snapshot); }
  void Save(TensorFile* file) const override { sound_->Save(file); }
  absl::Status Load(const TensorFile& file) override { return sound_->Load(file); }

 private:
  const std::unique_ptr<Algorithm> sound_;
  const absl::Status error_;
  int updates_ = 0;
};

TEST_F(TrainerTest, SavesNothingAfterAnUpdateThatFailed) {
  Insert(100);
  for (const absl::Status& error : {absl::InternalError("not finite"), absl::CancelledError("half an update"),
                                    absl::InvalidArgumentError("half an update")}) {
    const auto trainer =
        MakeTrainer(0, std::make_unique<Breaking>(MakeAlgorithm(SmallSpec()).value(), error));
    EXPECT_EQ(trainer->Run(), error);
    EXPECT_TRUE(
        absl::IsNotFound(Checkpoints(RunFolder{folder_.path()}.checkpoints(), 3).LoadNewest().status()));
  }
}

TEST_F(TrainerTest, ABatchOfOtherWidthsIsAFinalError) {
  Insert(100);
  ReplayClient client(replay_->address());
  Prefetcher prefetcher(&client, {.counts = {4, 0, 0}, .layout = {6, 1, 3}});
  const auto batches = prefetcher.Next();
  EXPECT_TRUE(absl::IsInvalidArgument(batches.status())) << batches.status();
  EXPECT_THAT(std::string(batches.status().message()), testing::HasSubstr("observation_width"));
}

}  // namespace
}  // namespace dbr
