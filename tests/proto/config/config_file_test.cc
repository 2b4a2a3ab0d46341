#include "proto/config/config_file.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_split.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using google::protobuf::util::MessageDifferencer;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

// Returns the lines of the error. Where there is only one, without "config: " in front.
std::vector<std::string> ErrorsOf(const std::string& text, const std::vector<std::string>& overrides = {}) {
  const absl::Status status = ParseConfig(text, overrides).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << "accepted: " << text;
  std::vector<std::string> lines = absl::StrSplit(std::string(status.message()), "\n  ");
  if (lines.size() == 1) return {lines[0].substr(std::string("config: ").size())};
  EXPECT_EQ(lines[0], "config: " + std::to_string(lines.size() - 1) + " errors:");
  lines.erase(lines.begin());
  return lines;
}

Config Parsed(const std::string& text, const std::vector<std::string>& overrides = {}) {
  const auto config = ParseConfig(text, overrides);
  EXPECT_TRUE(config.ok()) << config.status();
  return config.ok() ? *config : Config();
}

TEST(ParseConfigTest, EmptyTextIsThePapersTable) {
  const Config config = Parsed("");
  EXPECT_EQ(config.algorithm().discount(), 0.99);
  EXPECT_EQ(config.algorithm().learning_rate(), 3e-4);
  EXPECT_EQ(config.algorithm().target_tau(), 0.005);
  EXPECT_EQ(config.algorithm().batch_size(), 256u);
  EXPECT_EQ(config.replay().capacity(), 1000000u);
  EXPECT_EQ(config.replay().min_size(), 1000u);
  EXPECT_TRUE(config.algorithm().has_dbr());
  EXPECT_EQ(config.algorithm().dbr().epsilon(), 0.05);
  EXPECT_THAT(HiddenSizes(config), ElementsAre(256, 256, 256));
}

TEST(ParseConfigTest, ReadsEveryKindOfValue) {
  const Config config = Parsed(R"(
      # a comment
      seed: 0x1F
      env { name: 'conn' "ect4"; opponents: "random", opponents: ["one_ply", "mcts:10"] }
      network: < hidden_sizes: [64, 32] >
      algorithm { discount: 1e-1 dbr { constraint: FIXED repel_negative: true divergence: 1 } }
      actor { mode: GREEDY_Q })");
  EXPECT_EQ(config.seed(), 31u);
  EXPECT_EQ(config.env().name(), "connect4");
  EXPECT_THAT(config.env().opponents(), ElementsAre("random", "one_ply", "mcts:10"));
  EXPECT_THAT(HiddenSizes(config), ElementsAre(64, 32));
  EXPECT_EQ(config.algorithm().discount(), 0.1);
  EXPECT_EQ(config.algorithm().dbr().constraint(), DbrConfig::FIXED);
  EXPECT_EQ(config.algorithm().dbr().divergence(), DbrConfig::MMD_EXACT);
  EXPECT_TRUE(config.algorithm().dbr().repel_negative());
  EXPECT_EQ(config.actor().mode(), GREEDY_Q);
}

TEST(ParseConfigTest, ReportsEveryErrorAtOnceWithItsPlace) {
  EXPECT_THAT(
      ErrorsOf("sed: 3\n"
               "algorithm {\n"
               "  discont: 0.9 discount: 1.5\n"
               "  dbr { constraint: FIXD nonsense { a { b: [1, 2] } } }\n"
               "}\n"
               "replay { capacity: -1 }\n"
               "network { hidden_sizes: [256, 0] }\n",
               {"actor.envz=3"}),
      ElementsAre("1:1: sed: unknown field; did you mean 'seed'?",
                  "3:3: algorithm.discont: unknown field; did you mean 'discount'?",
                  "4:21: algorithm.dbr.constraint: expected one of DYNAMIC_MAX, DYNAMIC_MIN, FIXED, NONE, "
                  "found 'FIXD'; did you mean 'FIXED'?",
                  StartsWith("4:26: algorithm.dbr.nonsense: unknown field; known: constraint, divergence,"),
                  "6:20: replay.capacity: expected a whole number of 0 to 18446744073709551615, found '-1'",
                  "--set actor.envz: unknown field; did you mean 'envs'?",
                  "network.hidden_sizes[1]: expected 1 to 8192, found 0",
                  "algorithm.discount: expected 0 to 1, found 1.5"));
}

TEST(ParseConfigTest, NamesValuesOfAnotherType) {
  EXPECT_THAT(ErrorsOf("seed: x"), ElementsAre(HasSubstr("1:7: seed: expected a whole number of 0 to")));
  EXPECT_THAT(ErrorsOf("seed: 1.5"), ElementsAre(HasSubstr("found '1.5'")));
  EXPECT_THAT(ErrorsOf("seed: 18446744073709551616"),
              ElementsAre(HasSubstr("seed: expected a whole number")));
  EXPECT_THAT(ErrorsOf("seed: \"1\""), ElementsAre(HasSubstr("found '\"1\"'")));
  EXPECT_THAT(ErrorsOf("seed {}"), ElementsAre(HasSubstr("expected a value, found '{'")));
  EXPECT_THAT(ErrorsOf("env { name: connect4 }"),
              ElementsAre(HasSubstr("expected text in quotes, found connect4")));
  EXPECT_THAT(ErrorsOf("env: 3"), ElementsAre("1:6: expected '{', found '3'"));
  EXPECT_THAT(ErrorsOf("algorithm { discount: high }"),
              ElementsAre(HasSubstr("expected a number, found 'high'")));
  EXPECT_THAT(ErrorsOf("learner { allow_insecure: maybe }"),
              ElementsAre(HasSubstr("true or false, found 'maybe'")));
  EXPECT_THAT(ErrorsOf("network { precision: HALF }"),
              ElementsAre("1:22: network.precision: expected one of FLOAT32, BFLOAT16, AUTO, found 'HALF'"));
}

TEST(ParseConfigTest, NamesFieldsGivenTwice) {
  EXPECT_THAT(ErrorsOf("seed: 1 seed: 2"), ElementsAre("1:9: seed: expected once, found again"));
  EXPECT_THAT(ErrorsOf("env {} env {}"), ElementsAre("1:8: env: expected once, found again"));
}

TEST(ParseConfigTest, ABrokenStructureIsNamedWhereItIsFound) {
  EXPECT_THAT(ErrorsOf("seed 3"), ElementsAre("1:6: expected ':', found '3'"));
  EXPECT_THAT(ErrorsOf("algorithm {\n dbr {"), ElementsAre("2:7: expected '}', found the end"));
  EXPECT_THAT(ErrorsOf("}"), ElementsAre("1:1: expected the name of a field, found '}'"));
  EXPECT_THAT(ErrorsOf("network { hidden_sizes: [1 2] }"),
              ElementsAre("1:28: expected ',' or ']', found '2'"));
  EXPECT_THAT(ErrorsOf("unknown { {"), testing::Contains("1:12: expected a closing brace, found the end"));
  EXPECT_FALSE(ParseConfig("env { name: \"connect4\n }").ok());
}

TEST(ParseConfigTest, BoundsHoldForEveryNumber) {
  EXPECT_THAT(ErrorsOf("algorithm { learning_rate: 0 }"),
              ElementsAre("algorithm.learning_rate: expected more than 0 and at most 1, found 0"));
  EXPECT_THAT(ErrorsOf("algorithm { reward_scale: 0 }"),
              ElementsAre("algorithm.reward_scale: expected more than 0, found 0"));
  EXPECT_THAT(ErrorsOf("replay { capacity: 0 }"),
              ElementsAre("replay.capacity: expected at least 1, found 0"));
  EXPECT_THAT(ErrorsOf("algorithm { discount: nan }"),
              ElementsAre("algorithm.discount: expected 0 to 1, found nan"));
  EXPECT_THAT(ErrorsOf("algorithm { reward_scale: inf }"), ElementsAre(HasSubstr("algorithm.reward_scale")));
  EXPECT_THAT(ErrorsOf("algorithm { discount: -inf }"), ElementsAre(HasSubstr("found -inf")));
  EXPECT_THAT(ErrorsOf("env { name: \"\" }"), ElementsAre("env.name: expected a text, found an empty one"));
  EXPECT_TRUE(ParseConfig("algorithm { learning_rate: 1 discount: 0 }").ok());
}

TEST(ParseConfigTest, NoNumberOfTheSchemaMayBeInfinite) {
  EXPECT_THAT(
      ErrorsOf("replay { tolerance: inf } algorithm { dbr { epsilon: nan } }"),
      testing::UnorderedElementsAre(HasSubstr("replay.tolerance"), HasSubstr("algorithm.dbr.epsilon")));
}

TEST(OverrideTest, SetsFieldsByTheirPath) {
  const Config config =
      Parsed("algorithm { dbr { constraint: FIXED epsilon: 0.2 } } env { opponents: \"random\" }",
             {"algorithm.dbr.epsilon=0.1", "env.opponents=[one_ply, \"mcts:10\"]", "network.hidden_sizes=64",
              "actor.mode=SUPPORT", "learner.address=unix:/run/a=b.sock", "replay.seed_buffer.evict=true",
              "seed = 9"});
  EXPECT_EQ(config.algorithm().dbr().constraint(), DbrConfig::FIXED);
  EXPECT_EQ(config.algorithm().dbr().epsilon(), 0.1);
  EXPECT_THAT(config.env().opponents(), ElementsAre("one_ply", "mcts:10"));
  EXPECT_THAT(HiddenSizes(config), ElementsAre(64));
  EXPECT_EQ(config.actor().mode(), SUPPORT);
  EXPECT_EQ(config.learner().address(), "unix:/run/a=b.sock");
  EXPECT_TRUE(config.replay().seed_buffer().evict());
  EXPECT_EQ(config.seed(), 9u);
}

TEST(ConfigNamesTest, AFormerNameIsRefusedWithTheNewOne) {
  EXPECT_THAT(ErrorsOf("replay { seed { share: 0.5 } }"),
              ElementsAre(HasSubstr("replay.seed: this field is now called 'seed_buffer'")));
  EXPECT_THAT(ErrorsOf("", {"replay.seed.share=0.5"}),
              ElementsAre(HasSubstr("replay.seed: this field is now called 'seed_buffer'")));
}

TEST(ConfigNamesTest, AnAliasIsTheSameField) {
  const Config config = Parsed("algorithm { sac_discrete { first_temperature: 0.5 } }",
                               {"algorithm.sac_discrete.target_entropy_ratio=0.3"});
  EXPECT_EQ(config.algorithm().discrete_sac().first_temperature(), 0.5);
  EXPECT_EQ(config.algorithm().discrete_sac().target_entropy_ratio(), 0.3);
  EXPECT_THAT(PrintConfig(config), HasSubstr("discrete_sac"));
}

TEST(OverrideTest, EmptiesAListAndReplacesAMessage) {
  const Config config =
      Parsed("env { opponents: \"random\" } algorithm { dbr { constraint: FIXED epsilon: 0.2 } }",
             {"env.opponents=[]", "algorithm.dbr={epsilon: 0.3}"});
  EXPECT_TRUE(config.env().opponents().empty());
  EXPECT_EQ(config.algorithm().dbr().constraint(), DbrConfig::DYNAMIC_MAX);
  EXPECT_EQ(config.algorithm().dbr().epsilon(), 0.3);
}

TEST(OverrideTest, CorrectsAValueThatWasOutOfBounds) {
  EXPECT_EQ(Parsed("algorithm { discount: 2 }", {"algorithm.discount=0.5"}).algorithm().discount(), 0.5);
}

TEST(OverrideTest, ReportsEveryMistake) {
  EXPECT_THAT(ErrorsOf("", {"algorithm.dbr.epsilom=1", "foo", "env=3", "seed.x=1", "seed=x",
                            "algorithm.discount=7", "network.hidden_sizes=[64, y]"}),
              ElementsAre("--set algorithm.dbr.epsilom: unknown field; did you mean 'epsilon'?",
                          "--set expected path.to.field=value, found 'foo'",
                          "--set env: expected the path of a field within it, or fields in braces, found '3'",
                          "--set seed: has no fields within it, found 'x'",
                          StartsWith("--set seed: expected a whole"),
                          StartsWith("--set network.hidden_sizes: expected a whole"),
                          "algorithm.discount: expected 0 to 1, found 7"));
}

TEST(PrintConfigTest, PrintsEveryFieldOfTheSchema) {
  const std::string text = PrintConfig(Config());
  for (const char* field : {"seed: 1", "discount: 0.99", "hidden_sizes: [256, 256, 256]",
                            "constraint: DYNAMIC_MAX", "capacity: 1000000", "push_every: 50", "envs: 256",
                            "every_s: 10", "max_restarts: 5", "address: \"\""}) {
    EXPECT_THAT(text, HasSubstr(field));
  }
}

TEST(PrintConfigTest, ReadsBackAsItself) {
  const Config config = Parsed(
      "env { name: \"a \\\"quoted\\\" name\" opponents: \"random\" } network { hidden_sizes: 7 } "
      "algorithm { learning_rate: 0.00012345678901234567 dbr { constraint: FIXED } }");
  const std::string text = PrintConfig(config);
  const Config again = Parsed(text);
  EXPECT_EQ(PrintConfig(again), text);
  EXPECT_EQ(again.algorithm().learning_rate(), config.algorithm().learning_rate());
  EXPECT_EQ(again.env().name(), config.env().name());
  // The printed config sets every field, so nothing is left to default when it is parsed.
  EXPECT_TRUE(MessageDifferencer::Equals(again, Parsed(PrintConfig(again))));
}

// The configs that are shipped, and one of each algorithm.
std::vector<Config> SeveralConfigs() {
  std::vector<Config> configs = {Config(),
                                 Parsed("network { hidden_sizes: [7, 9] } env { opponents: \"random\" }")};
  for (const auto& entry : std::filesystem::directory_iterator(DBR_SOURCE_DIR "/deploy/configs"))
    configs.push_back(LoadConfig(entry.path().string()).value());
  for (const char* algorithm : {"dbr", "sac", "bear", "brac", "td3", "awac", "ddqn", "discrete_sac"})
    configs.push_back(
        Parsed("algorithm { learning_rate: 0.00012345678901234567 " + std::string(algorithm) + " {} }"));
  return configs;
}

TEST(WithDefaultsTest, IsWhatThePrintedConfigReadsBackAs) {
  const std::vector<Config> configs = SeveralConfigs();
  EXPECT_GT(configs.size(), 15);
  for (const Config& config : configs) {
    const std::string text = PrintConfig(config);
    EXPECT_TRUE(MessageDifferencer::Equals(WithDefaults(config), Parsed(text))) << text;
  }
}

TEST(WithDefaultsTest, ADefaultThatIsWrittenOutChangesNothing) {
  const Config short_one = Parsed("algorithm { sac {} }");
  const Config long_one = Parsed(
      "seed: 1 algorithm { discount: 0.99 sac { first_temperature: 1 } } "
      "network { hidden_sizes: [256, 256, 256] }");
  EXPECT_FALSE(MessageDifferencer::Equals(short_one, long_one));
  EXPECT_TRUE(MessageDifferencer::Equals(WithDefaults(short_one), WithDefaults(long_one)));
  EXPECT_TRUE(MessageDifferencer::Equals(WithDefaults(short_one), WithDefaults(WithDefaults(short_one))));
}

TEST(OptionalColumnsOfTest, ReturnsAreForSelfImitationAndTheFloorOfQ) {
  const auto returns = [](const char* text) { return OptionalColumnsOf(Parsed(text).algorithm()).returns; };
  EXPECT_FALSE(returns(""));
  EXPECT_FALSE(returns("algorithm { dbr { advantage: ARM_CUMULATIVE } }"));
  EXPECT_TRUE(returns("algorithm { dbr { advantage: SIL } }"));
  EXPECT_FALSE(returns("algorithm { sac {} }"));
  EXPECT_TRUE(returns("algorithm { cal_ql {} }"));
}

TEST(OptionalColumnsOfTest, NextActionsAreForThePenaltyOfTheTarget) {
  const auto next_actions = [](const char* text) {
    return OptionalColumnsOf(Parsed(text).algorithm()).next_actions;
  };
  EXPECT_FALSE(next_actions(""));
  EXPECT_FALSE(next_actions("algorithm { td3_bc {} }"));
  EXPECT_TRUE(next_actions("algorithm { rebrac {} }"));
  EXPECT_FALSE(next_actions("algorithm { rebrac { critic_penalty: 0 } }"));
}

TEST(LoadConfigTest, ErrorsStartWithTheFile) {
  const TempDir folder;
  const std::string path = folder / "bad.textproto";
  std::ofstream(path) << "sed: 3\nalgorithm { discount: 2 }";
  const absl::Status status = LoadConfig(path).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), StartsWith(path + ": 2 errors:\n  1:1: sed: unknown field"));
  EXPECT_EQ(LoadConfig(folder / "none").status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(LoadConfig(folder / "none").status().message()), HasSubstr(folder / "none"));
}

TEST(LoadConfigTest, AByteOrderMarkBeforeTheTextIsPassedOver) {
  const TempDir folder;
  const std::string path = folder / "marked.textproto";
  std::ofstream(path) << "\xEF\xBB\xBFseed: 3";
  const auto config = LoadConfig(path);
  ASSERT_TRUE(config.ok()) << config.status();
  EXPECT_EQ(config->seed(), 3u);
}

TEST(LoadConfigTest, ReadsAFileWithOverrides) {
  const TempDir folder;
  const std::string path = folder / "good.textproto";
  std::ofstream(path) << "seed: 3";
  const auto config = LoadConfig(path, {"actor.envs=8"});
  ASSERT_TRUE(config.ok()) << config.status();
  EXPECT_EQ(config->seed(), 3u);
  EXPECT_EQ(config->actor().envs(), 8u);
}

}  // namespace
}  // namespace dbr
