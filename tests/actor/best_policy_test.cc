#include "actor/best_policy.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "actor/evaluation_loop.h"
#include "core/file_io.h"
#include "core/safetensors.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/test_policies.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr char kMeasure[] = "connect4 against random by MODE";

class BestPolicyTest : public ::testing::Test {
 protected:
  // Offers a policy as an evaluator of its own would, which has just started.
  void OfferAfterAStart(double mean, std::uint64_t version, const std::string& measure = kMeasure) {
    BestPolicy(path_, measure).Offer(mean, RAW, UntrainedSnapshot(Connect4Spec(), version));
  }
  // The version in the file; 0 where there is none.
  std::uint64_t Kept() const {
    const auto policy = LoadPolicy(path_);
    return policy.ok() ? policy->version : 0;
  }

  TempDir folder_;
  const std::string path_ = folder_ / "policy/best.safetensors";
};

TEST_F(BestPolicyTest, KeepsEachPolicyThatIsBetterThanAllBeforeIt) {
  BestPolicy best(path_, kMeasure);
  std::uint64_t version = 0;
  std::vector<std::uint64_t> kept;
  for (const double mean : {-0.5, -0.6, -0.5, 0.25, 0.0, static_cast<double>(NAN), 0.5}) {
    best.Offer(mean, RAW, UntrainedSnapshot(Connect4Spec(), ++version));
    kept.push_back(Kept());
  }
  EXPECT_THAT(kept, ::testing::ElementsAre(1, 1, 1, 4, 4, 4, 7));
  EXPECT_EQ(best.mean(), 0.5);
}

TEST_F(BestPolicyTest, TheFileSaysWhichPolicyEarnedItsFigure) {
  BestPolicy best(path_, kMeasure);
  double mean = 0;
  for (const auto& [played, name] : {std::pair(AVERAGE, "average"), std::pair(RAW, "raw")}) {
    const PolicySnapshot snapshot = UntrainedSnapshot(Connect4Spec(), 1);
    best.Offer(++mean, played, snapshot);
    EXPECT_EQ(LoadTensors(path_)->metadata["evaluation.policy"], name);
    EXPECT_EQ(LoadPolicy(path_)->networks, snapshot.networks);
  }
}

TEST_F(BestPolicyTest, AnEvaluatorThatStartsAgainDoesNotReplaceItByAWorseOne) {
  OfferAfterAStart(0.1 + 0.2, 1);
  OfferAfterAStart(0.25, 2);
  OfferAfterAStart(0.1 + 0.2, 3);  // as good, to the last bit
  EXPECT_EQ(Kept(), 1u);
  OfferAfterAStart(0.75, 4);
  EXPECT_EQ(Kept(), 4u);
}

TEST_F(BestPolicyTest, ADamagedFileIsNoRival) {
  for (const bool in_header : {true, false}) {
    OfferAfterAStart(0.9, 1);
    std::string bytes = *ReadFile(path_);
    bytes[in_header ? 40 : bytes.size() - 1] ^= 1;
    ASSERT_TRUE(WriteFileAtomically(path_, bytes).ok());
    OfferAfterAStart(0.1, 2);
    EXPECT_EQ(Kept(), 2u) << in_header;
  }
}

TEST_F(BestPolicyTest, AFigureThatIsNoneOrOfAnotherMeasureIsNoRival) {
  ASSERT_TRUE(std::filesystem::create_directories(folder_ / "policy"));
  ASSERT_TRUE(SavePolicy(UntrainedSnapshot(Connect4Spec(), 1), path_).ok());  // says no figure
  OfferAfterAStart(0.1, 2);
  EXPECT_EQ(Kept(), 2u);
  OfferAfterAStart(0.05, 3, "connect4 against one_ply by MODE");
  EXPECT_EQ(Kept(), 3u);
  auto file = LoadTensors(path_);
  ASSERT_TRUE(file.ok());
  for (const char* mean : {"nan", "inf", "much"}) {
    file->metadata["evaluation.mean"] = mean;
    ASSERT_TRUE(SaveTensors(*file, path_).ok());
    EXPECT_EQ(BestPolicy(path_, "connect4 against one_ply by MODE").mean(),
              -std::numeric_limits<double>::infinity())
        << mean;
  }
}

TEST_F(BestPolicyTest, WhatCannotBeWrittenIsComparedAgain) {
  const std::string blocked = folder_ / "policy";
  ASSERT_TRUE(WriteFileAtomically(blocked, "a file in the place of the folder").ok());
  BestPolicy best(path_, kMeasure);
  best.Offer(0.9, RAW, UntrainedSnapshot(Connect4Spec(), 1));
  ASSERT_TRUE(std::filesystem::remove(blocked));
  best.Offer(0.5, RAW, UntrainedSnapshot(Connect4Spec(), 2));
  EXPECT_EQ(Kept(), 2u);
}

TEST_F(BestPolicyTest, WithoutAFileNothingIsKept) {
  BestPolicy best("", kMeasure);
  best.Offer(1, RAW, UntrainedSnapshot(Connect4Spec(), 1));
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

TEST(MeasureTest, NamesAllThatAFigureDependsOn) {
  EvaluationLoopOptions options;
  options.opponents = {"random", "mcts:10"};
  options.mode = SAMPLE;
  EXPECT_EQ(MeasureOf("connect4", options), "connect4 against random, mcts:10 by SAMPLE");
  options.opponents = {""};
  options.mode = MODE;
  EXPECT_EQ(MeasureOf("hopper", options), "hopper by MODE");
}

}  // namespace
}  // namespace dbr
