#include "proto/config/config_combinations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "proto/config/config_file.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string ErrorOf(const std::string& algorithm) {
  const auto config = ParseConfig("algorithm { " + algorithm + " }");
  EXPECT_EQ(config.status().code(), absl::StatusCode::kInvalidArgument) << "accepted: " << algorithm;
  return std::string(config.status().message());
}

TEST(ConfigCombinations, RefusesEachContradictionByName) {
  EXPECT_THAT(ErrorOf("critics: 1"),
              HasSubstr("algorithm.target_critics: expected at most algorithm.critics (1), found 2"));
  EXPECT_THAT(ErrorOf("dbr { max_repulsion: 3 }"),
              HasSubstr("algorithm.dbr.max_repulsion: expected repel_negative: true with it, found 3"));
  EXPECT_THAT(ErrorOf("dbr { first_temperature: 1 constraint: NONE }"),
              HasSubstr("algorithm.dbr.target_entropy: expected a value where constraint is NONE"));
  EXPECT_THAT(ErrorOf("dbr { first_temperature: 1 entropy_weight: 0.1 }"),
              HasSubstr("algorithm.dbr.entropy_weight: expected 0 with a first_temperature above 0"));
  EXPECT_THAT(ErrorOf("dbr { min_multiplier: 2 max_multiplier: 1 }"),
              HasSubstr("algorithm.dbr.min_multiplier: expected at most max_multiplier (1), found 2"));
  EXPECT_THAT(ErrorOf("dbr { min_multiplier: 2 }"),
              HasSubstr("algorithm.dbr.first_multiplier: expected min_multiplier (2)"));
  EXPECT_THAT(ErrorOf("dbr { advantage: SIL behavior_data: BATCH }"),
              HasSubstr("algorithm.dbr.behavior_data: expected PARTITIONS with advantage: SIL"));
  EXPECT_THAT(ErrorOf("n_step: 2 dbr { munchausen_weight: 0.5 }"),
              HasSubstr("algorithm.n_step: expected 1 with"));
}

TEST(ConfigCombinations, RefusesAllAtOnce) {
  EXPECT_THAT(
      ErrorOf("critics: 1 dbr { max_repulsion: 3 first_temperature: 1 entropy_weight: 1 epsilon: -1 }"),
      AllOf(HasSubstr("4 errors"), HasSubstr("target_critics"), HasSubstr("max_repulsion"),
            HasSubstr("entropy_weight"), HasSubstr("epsilon")));
}

TEST(ConfigCombinations, AcceptsWhatFits) {
  for (const char* algorithm :
       {"critics: 1 target_critics: 1", "critics: 5", "dbr { repel_negative: true max_repulsion: 3 }",
        "dbr { first_temperature: 1 constraint: NONE target_entropy: -1 }",
        "dbr { first_temperature: 1 constraint: NONE target_entropy_ratio: 0.3 }",
        "dbr { min_multiplier: 0 first_multiplier: 0.1 }", "n_step: 2"}) {
    const auto config = ParseConfig(std::string("algorithm { ") + algorithm + " }");
    EXPECT_TRUE(config.ok()) << algorithm << ": " << config.status();
  }
}

// A learner reads the config that the launch has printed, with every field set.
TEST(ConfigCombinations, AcceptsEveryShippedConfigAsItIsPrinted) {
  int configs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DBR_SOURCE_DIR "/deploy/configs")) {
    const auto config = LoadConfig(entry.path().string());
    ASSERT_TRUE(config.ok()) << config.status();
    const auto again = ParseConfig(PrintConfig(*config));
    EXPECT_TRUE(again.ok()) << entry.path() << ": " << again.status();
    ++configs;
  }
  EXPECT_GE(configs, 10);
}

}  // namespace
}  // namespace dbr
