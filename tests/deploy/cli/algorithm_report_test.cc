// `dbr algorithms`: what it says about each algorithm of the registry.
#include "deploy/cli/algorithm_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "learner/algorithms/registry.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(AlgorithmsTest, EachStandsOnceWithAllItsActions) {
  std::set<std::string> names, registered;
  for (const AlgorithmId& id : Algorithms()) registered.insert(id.name);
  std::size_t served = 0;
  for (const AlgorithmFacts& one : AllAlgorithms()) {
    EXPECT_TRUE(names.insert(one.name).second) << one.name;
    EXPECT_FALSE(one.source.empty()) << one.name;
    served += one.actions.size();
  }
  EXPECT_EQ(names, registered);
  EXPECT_EQ(served, Algorithms().size());
}

TEST(AlgorithmsTest, TheTableNamesSourceActionsAndWhatEachVariantCanBe) {
  EXPECT_THAT(AlgorithmTable(AllAlgorithms()),
              AllOf(HasSubstr("dbr"), HasSubstr("discrete, continuous"), HasSubstr("Siu, Traish, Xu 2021"),
                    HasSubstr("constraint: DYNAMIC_MAX | DYNAMIC_MIN | FIXED | NONE"),
                    HasSubstr("repel_negative: false | true")));
}

TEST(AlgorithmsTest, TheTextOfEachIsAConfigThatSetsItAtItsDefaults) {
  for (const AlgorithmFacts& one : AllAlgorithms()) {
    const auto config = ParseConfig(AlgorithmText(one));
    ASSERT_TRUE(config.ok()) << one.name << ": " << config.status();
    EXPECT_EQ(AlgorithmName(config->algorithm()), one.name);
    const auto defaults = ParseConfig("algorithm { " + one.name + " {} }");
    ASSERT_TRUE(defaults.ok());
    EXPECT_EQ(PrintConfig(*config), PrintConfig(*defaults));
  }
}

TEST(AlgorithmsTest, TheTextSaysWhatAFieldTakes) {
  const std::string text = AlgorithmText(*FindAlgorithm("dbr"));
  EXPECT_THAT(text, AllOf(HasSubstr("epsilon: 0.05"), HasSubstr("# above 0\n"), HasSubstr("# 0 to 1\n"),
                          HasSubstr("DYNAMIC_MAX | DYNAMIC_MIN | FIXED | NONE; a variant\n")));
}

TEST(AlgorithmsTest, AnUnknownNameIsRefusedWithTheNearestOrAllKnownOnes) {
  const absl::Status near = FindAlgorithm("dbrr").status(), far = FindAlgorithm("nonsense").status();
  EXPECT_EQ(near.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(near.message()), AllOf(HasSubstr("found 'dbrr'"), HasSubstr("did you mean 'dbr'")));
  EXPECT_THAT(std::string(far.message()), HasSubstr("known: dbr, bear, sac"));
}

TEST(AlgorithmsTest, JsonHasTheSame) {
  const nlohmann::ordered_json json = ToJson(*FindAlgorithm("dbr"));
  EXPECT_EQ(json["name"], "dbr");
  EXPECT_THAT(json["actions"].get<std::vector<std::string>>(), ElementsAre("discrete", "continuous"));
  EXPECT_EQ(json["variants"]["constraint"][0], "DYNAMIC_MAX");
  EXPECT_TRUE(json["variants"]["munchausen_weight"].is_null());  // a number
  EXPECT_EQ(json["fields"][2]["name"], "epsilon");
  EXPECT_EQ(json["fields"][2]["default"], "0.05");
  EXPECT_EQ(json["fields"][2]["bounds"], "above 0");
}

}  // namespace
}  // namespace dbr
