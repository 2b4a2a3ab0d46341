// Tests that fields which contradict each other are refused when a config is read, each by its name and all
// at once, and that what is printed is never refused.
#include "proto/config/config_combinations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

// Returns the errors, each from its field on. The list is empty where the config is accepted.
std::vector<std::string> ErrorsOfAlgorithm(const std::string& settings) {
  const auto config = ParseConfig(absl::StrCat("algorithm { ", settings, " }"));
  if (config.ok()) return {};
  EXPECT_TRUE(absl::IsInvalidArgument(config.status()));
  const std::string message(config.status().message());
  std::vector<std::string> lines;
  for (std::size_t at = message.find("algorithm."); at != std::string::npos;) {
    const std::size_t end = message.find('\n', at);
    lines.push_back(message.substr(at, end == std::string::npos ? end : end - at));
    at = end == std::string::npos ? end : message.find("algorithm.", end);
  }
  return lines;
}
std::vector<std::string> ErrorsOfDbr(const std::string& settings) {
  return ErrorsOfAlgorithm(absl::StrCat("dbr { ", settings, " }"));
}

TEST(ConfigCombinations, NoMoreCriticsAreAskedThanThereAre) {
  EXPECT_THAT(ErrorsOfAlgorithm("critics: 1"),
              ElementsAre("algorithm.target_critics: expected at most algorithm.critics (1), found 2"));
  EXPECT_THAT(ErrorsOfAlgorithm("critics: 1 sac {}"), ElementsAre(StartsWith("algorithm.target_critics")));
  EXPECT_THAT(ErrorsOfAlgorithm("critics: 1 target_critics: 1"), ElementsAre());
  EXPECT_THAT(ErrorsOfAlgorithm("critics: 4"), ElementsAre());
}

TEST(ConfigCombinations, ActionsStandForTheBehavioursOfDbrAlone) {
  EXPECT_THAT(ErrorsOfDbr("divergence: ACTIONS value_penalty: true"),
              ElementsAre(HasSubstr("algorithm.dbr.value_penalty: expected false with divergence: ACTIONS")));
  EXPECT_THAT(
      ErrorsOfDbr("action_weights: MARGIN"),
      ElementsAre("algorithm.dbr.action_weights: expected divergence: ACTIONS with it, found MARGIN and "
                  "divergence: KL"));
  EXPECT_THAT(ErrorsOfDbr("divergence: ACTIONS action_weights: MARGIN"), ElementsAre());
  EXPECT_THAT(ErrorsOfAlgorithm("bear { divergence: ACTIONS }"),
              ElementsAre(HasSubstr("algorithm.bear.divergence: expected one between policies")));
}

TEST(ConfigCombinations, AShareMovesOverANumberOfTransitions) {
  const auto message = [](const std::string& settings) {
    return ParseConfig(absl::StrCat("replay { seed_buffer { ", settings, " } }")).status().ToString();
  };
  EXPECT_THAT(message("share: 0.5 final_share: 0.25"),
              HasSubstr("replay.seed_buffer.share_decay_transitions: expected above 0 with a final_share"));
  EXPECT_EQ(message("share: 0.5 final_share: 0.25 share_decay_transitions: 10"), "OK");
  EXPECT_EQ(message("share: 0.5 share_decay_transitions: 10"), "OK");
}

TEST(ConfigCombinations, DoubleDqnHasNoEnsemble) {
  EXPECT_THAT(
      ErrorsOfAlgorithm("ddqn {} critics: 4"),
      ElementsAre("algorithm.critics: expected 2 of which 2 are asked with ddqn, whose one network is its "
                  "critic, found 4 of which 2"));
  EXPECT_THAT(ErrorsOfAlgorithm("ddqn {} target_critics: 1"), ElementsAre(HasSubstr("found 2 of which 1")));
  EXPECT_THAT(ErrorsOfAlgorithm("ddqn {}"), ElementsAre());
  const auto normalised = ParseConfig("network { critic_layer_norm: true } algorithm { ddqn {} }");
  EXPECT_THAT(std::string(normalised.status().message()),
              HasSubstr("network.critic_layer_norm: expected false with ddqn"));
}

TEST(ConfigCombinations, TheMultiplierBeginsBetweenItsLimits) {
  EXPECT_THAT(ErrorsOfDbr("first_multiplier: 3 max_multiplier: 2"),
              ElementsAre(AllOf(StartsWith("algorithm.dbr.first_multiplier: expected min_multiplier ("),
                                HasSubstr("to max_multiplier (2), found 3"))));
  EXPECT_THAT(ErrorsOfDbr("first_multiplier: 0.1 min_multiplier: 0.5"),
              ElementsAre(AllOf(StartsWith("algorithm.dbr.first_multiplier"), HasSubstr("found 0.1"))));
  EXPECT_THAT(ErrorsOfDbr("max_multiplier: 0.5"), ElementsAre(HasSubstr("found 1")))
      << "the default of first_multiplier";
  EXPECT_THAT(ErrorsOfDbr("min_multiplier: 3 max_multiplier: 2"),
              ElementsAre("algorithm.dbr.min_multiplier: expected at most max_multiplier (2), found 3"));
  EXPECT_THAT(ErrorsOfDbr("min_multiplier: 0 first_multiplier: 2 max_multiplier: 2"), ElementsAre());
}

TEST(ConfigCombinations, TheEntropyHasOneWeight) {
  EXPECT_THAT(ErrorsOfDbr("first_temperature: 1 entropy_weight: 0.1"),
              ElementsAre(AllOf(StartsWith("algorithm.dbr.entropy_weight: expected 0"),
                                HasSubstr("first_temperature"), HasSubstr("found 0.1"))));
  EXPECT_THAT(ErrorsOfDbr("entropy_weight: 0.1"), ElementsAre());
  EXPECT_THAT(ErrorsOfDbr("first_temperature: 1"), ElementsAre());
}

TEST(ConfigCombinations, ATemperatureAloneNamesItsTarget) {
  EXPECT_THAT(ErrorsOfDbr("constraint: NONE first_temperature: 1"),
              ElementsAre(AllOf(StartsWith("algorithm.dbr.target_entropy: expected a value"),
                                HasSubstr("constraint is NONE"), HasSubstr("found none"))));
  EXPECT_THAT(ErrorsOfDbr("constraint: NONE first_temperature: 1 target_entropy: -1"), ElementsAre());
  EXPECT_THAT(ErrorsOfDbr("constraint: NONE first_temperature: 1 target_entropy_ratio: 0.5"), ElementsAre());
  EXPECT_THAT(ErrorsOfDbr("constraint: NONE"), ElementsAre());
}

TEST(ConfigCombinations, ACapNeedsTheRepulsionThatItCaps) {
  EXPECT_THAT(ErrorsOfDbr("max_repulsion: 3"),
              ElementsAre("algorithm.dbr.max_repulsion: expected repel_negative: true with it, found 3 and "
                          "repel_negative: false"));
  EXPECT_THAT(ErrorsOfDbr("max_repulsion: 3 repel_negative: true"), ElementsAre());
  EXPECT_THAT(ErrorsOfDbr("max_repulsion: 6"), ElementsAre()) << "the default, as a printed config has it";
}

TEST(ConfigCombinations, SelfImitationFitsItsBehaviourInItsOwnWay) {
  EXPECT_THAT(ErrorsOfDbr("behavior_data: BATCH advantage: SIL"),
              ElementsAre(AllOf(StartsWith("algorithm.dbr.behavior_data: expected PARTITIONS"),
                                HasSubstr("advantage: SIL"), HasSubstr("found BATCH"))));
  EXPECT_THAT(ErrorsOfDbr("behavior_data: BATCH"), ElementsAre());
  EXPECT_THAT(ErrorsOfDbr("advantage: SIL"), ElementsAre());
}

TEST(ConfigCombinations, TheMunchausenTermIsOfOneStep) {
  EXPECT_THAT(ErrorsOfAlgorithm("n_step: 3 dbr { munchausen_weight: 0.9 }"),
              ElementsAre(AllOf(StartsWith("algorithm.n_step: expected 1"), HasSubstr("munchausen_weight"),
                                HasSubstr("found 3"))));
  EXPECT_THAT(ErrorsOfAlgorithm("n_step: 3 dbr {}"), ElementsAre());
  EXPECT_THAT(ErrorsOfAlgorithm("dbr { munchausen_weight: 0.9 }"), ElementsAre());
}

std::string ErrorOf(const std::string& text) {
  return std::string(ParseConfig(text).status().message());
}

TEST(ConfigCombinations, FineTuningNeedsTwoPhasesAndSetsTheShare) {
  EXPECT_TRUE(ParseConfig("learner { offline_updates: 10 } finetune { mode: AUTO }").ok());
  EXPECT_THAT(ErrorOf("finetune { mode: AUTO }"),
              HasSubstr("finetune.mode: expected NONE, or learner.offline_updates above 0"));
  EXPECT_THAT(ErrorOf("learner { offline_updates: 10 max_updates: 10 } finetune { mode: RETAIN }"),
              HasSubstr("found RETAIN with 10 and 10"));
  EXPECT_THAT(ErrorOf("learner { offline_updates: 10 } finetune { mode: WARM_START } "
                      "replay { seed_buffer { share: 0.5 } }"),
              HasSubstr("replay.seed_buffer.share: expected 0 and no decay with finetune.mode: WARM_START"));
}

TEST(ConfigCombinations, ASchedulesFieldsFitTogether) {
  const auto error = [](const std::string& schedule,
                        const std::string& algorithm = "dbr { first_temperature: 1 }") {
    return ErrorOf("learner { offline_updates: 10 } algorithm { " + algorithm + " } finetune { mode: AUTO " +
                   schedule + " }");
  };
  EXPECT_EQ(error("multiplier { first: 20 last: 1 updates: 5 }"), "");
  EXPECT_EQ(error("target_entropy { first: -4 last: -1 updates: 5 }"), "");
  EXPECT_THAT(error("multiplier { first: 20 last: 1 }"),
              HasSubstr("finetune.multiplier.updates: expected above 0 with first and last, found 0"));
  EXPECT_THAT(error("temperature { first: 0.1 updates: 5 }"),
              HasSubstr("finetune.temperature: expected first and last above 0, found 0.1 and 0"));
  EXPECT_THAT(error("multiplier { first: 20 last: 1 updates: 5 }", "sac {}"),
              HasSubstr("finetune.multiplier: expected algorithm dbr"));
  EXPECT_THAT(error("multiplier { first: 20 last: 1 updates: 5 }",
                    "dbr { constraint: NONE first_temperature: 1 target_entropy: -1 }"),
              HasSubstr("finetune.multiplier: expected a constraint other than NONE"));
  EXPECT_THAT(error("target_entropy { first: -4 last: -1 updates: 5 }", "dbr {}"),
              HasSubstr("finetune.target_entropy: expected algorithm.dbr.first_temperature above 0"));
  EXPECT_THAT(error("target_entropy { last: -1 updates: 5 } temperature { first: 1 last: 1 updates: 5 }"),
              HasSubstr("finetune.target_entropy: expected none with finetune.temperature"));
  EXPECT_THAT(ErrorOf("finetune { multiplier { first: 20 last: 1 updates: 5 } }"),
              HasSubstr("finetune.mode: expected RETAIN, WARM_START or AUTO with a schedule, found NONE"));
}

TEST(ConfigCombinations, AllAreReportedAtOnceBesideFieldsOutOfBounds) {
  EXPECT_THAT(
      ErrorsOfAlgorithm("discount: 2 critics: 1 n_step: 2 dbr { constraint: NONE first_temperature: 1 "
                        "entropy_weight: 0.1 min_multiplier: 3 max_multiplier: 2 max_repulsion: 1 "
                        "behavior_data: BATCH advantage: SIL munchausen_weight: 0.5 }"),
      testing::UnorderedElementsAre(
          StartsWith("algorithm.discount"), StartsWith("algorithm.target_critics"),
          StartsWith("algorithm.n_step"), StartsWith("algorithm.dbr.target_entropy"),
          StartsWith("algorithm.dbr.entropy_weight"), StartsWith("algorithm.dbr.min_multiplier"),
          StartsWith("algorithm.dbr.max_repulsion"), StartsWith("algorithm.dbr.behavior_data")));
}

TEST(ConfigCombinations, AnOverrideIsJudgedWithTheRest) {
  EXPECT_FALSE(ParseConfig("algorithm { critics: 4 target_critics: 2 }", {"algorithm.critics=1"}).ok());
  EXPECT_TRUE(ParseConfig("algorithm { critics: 1 }", {"algorithm.target_critics=1"}).ok());
}

// A printed config sets every field, also those that would contradict others if a user had set them.
TEST(ConfigCombinations, APrintedConfigReadsBackWithoutAnError) {
  std::vector<std::string> texts = {"",
                                    "algorithm { dbr { first_temperature: 1 } }",
                                    "algorithm { dbr { repel_negative: true max_repulsion: 0 } }",
                                    "algorithm { dbr { behavior_data: BATCH min_multiplier: 0 } }",
                                    "algorithm { critics: 1 target_critics: 1 sac {} }",
                                    "algorithm { n_step: 5 discrete_sac {} }"};
  for (const auto& entry : std::filesystem::directory_iterator(DBR_SOURCE_DIR "/deploy/configs")) {
    const auto shipped = LoadConfig(entry.path().string());
    ASSERT_TRUE(shipped.ok()) << shipped.status();
    texts.push_back(PrintConfig(*shipped));
  }
  EXPECT_GT(texts.size(), 12u);
  for (const std::string& text : texts) {
    const auto config = ParseConfig(text);
    ASSERT_TRUE(config.ok()) << config.status();
    const std::string printed = PrintConfig(*config);
    const auto again = ParseConfig(printed);
    EXPECT_TRUE(again.ok()) << again.status();
    if (again.ok()) {
      EXPECT_EQ(PrintConfig(*again), printed);
    }
  }
}

}  // namespace
}  // namespace dbr
