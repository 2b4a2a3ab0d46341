#include "envs/registry/registry.h"

#include <algorithm>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(EnvRegistry, NamesAreSortedAndCanBeMade) {
  const std::vector<std::string> names = EnvNames();
  EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
  EXPECT_THAT(names, testing::Contains("connect4"));
  for (const std::string& name : names) {
    const auto env = MakeEnv({.name = name, .opponents = {}});
    ASSERT_TRUE(env.ok()) << env.status();
    EXPECT_EQ((*env)->spec().name, name);
  }
}

TEST(EnvRegistry, AnAliasMakesTheSameEnvironment) {
  const auto env = MakeEnv({.name = "connect_four", .opponents = {"one_ply"}});
  ASSERT_TRUE(env.ok()) << env.status();
  EXPECT_EQ((*env)->spec().name, "connect4");
  EXPECT_EQ(EvaluationOpponents("connect_four"), EvaluationOpponents("connect4"));
}

TEST(EnvRegistry, AnUnknownNameIsAnsweredWithTheKnownOnes) {
  const absl::Status status = MakeEnv({.name = "conect4", .opponents = {}}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("\"conect4\""));
  for (const std::string& name : EnvNames()) EXPECT_THAT(std::string(status.message()), HasSubstr(name));
}

TEST(EnvRegistry, AnUnknownOpponentIsAnsweredWithTheKnownOnes) {
  const absl::Status status = MakeEnv({.name = "connect4", .opponents = {"random", "mcts"}}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("\"mcts\""), HasSubstr("random, one_ply or mcts:N")));
}

TEST(EnvRegistry, OnlyTwoPlayerGamesHaveRandomStarts) {
  for (const std::string& name : EnvNames()) {
    const absl::Status status = MakeEnv({.name = name, .opponents = {}, .random_start_share = 0.5}).status();
    if (name == "connect4") {
      EXPECT_TRUE(status.ok()) << status;
    } else {
      EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << name;
      EXPECT_THAT(std::string(status.message()),
                  AllOf(HasSubstr(name), HasSubstr("expected env.random_start_share: 0, found 0.5")));
    }
  }
}

TEST(EnvRegistry, ActorsTrainOnWhatTheConfigSays) {
  EnvConfig config;
  config.set_name("connect4");
  config.add_opponents("one_ply");
  config.set_random_start_share(0.25);
  const EnvOptions options = TrainingEnv(config);
  EXPECT_EQ(options.name, "connect4");
  EXPECT_THAT(options.opponents, ElementsAre("one_ply"));
  EXPECT_EQ(options.random_start_share, 0.25);
}

TEST(EnvRegistry, TheBoardHasASymmetryAndTheRobotsHaveNone) {
  for (const std::string& name : EnvNames()) {
    EXPECT_EQ(MakeEnv({.name = name, .opponents = {}}).value()->spec().symmetry.empty(), name != "connect4")
        << name;
  }
}

TEST(EnvRegistry, PeopleAreToldOfAnEnvironmentByItsNameOrAlias) {
  EXPECT_EQ(PresentationOf("connect_four").episodes, "games");
  EXPECT_EQ(PresentationOf("hopper").episodes, "episodes");
  EXPECT_THAT(PresentationOf("hopper").watched, IsEmpty());
  EXPECT_THAT(PresentationOf("conect4").published, IsEmpty());
}

TEST(EnvRegistry, WatchedOpponentsAreAmongThoseOfTheEvaluation) {
  for (const std::string& name : EnvNames()) {
    for (const WatchedOpponent& opponent : PresentationOf(name).watched) {
      EXPECT_THAT(EvaluationOpponents(name), testing::Contains(opponent.name));
      EXPECT_LT(opponent.short_name.size(), opponent.name.size());
    }
  }
}

TEST(EnvRegistry, EvaluationOpponentsCanBeMetAndUnknownNamesHaveNone) {
  EXPECT_THAT(EvaluationOpponents("connect4"), ElementsAre("random", "one_ply", "mcts:10", "mcts:100"));
  EXPECT_THAT(EvaluationOpponents("conect4"), IsEmpty());
}

}  // namespace
}  // namespace dbr
