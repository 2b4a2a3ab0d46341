// The cells of a grid: their configs, their order, and what is wrong with a grid.
#include "deploy/experiment/grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"
#include "deploy/experiment/cell.h"
#include "deploy/experiment/check.h"
#include "proto/config/config_file.h"
#include "proto/config/experiment_file.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::StartsWith;

constexpr char kGrid[] = R"(
name: "tiny"
base { network { hidden_sizes: 16 } algorithm { discount: 0.5 learning_rate: 0.1 target_tau: 0.1 batch_size: 2 } }
task {
  name: "connect4" kind: GAMES
  config { env { name: "connect4" } network { hidden_sizes: 8 } algorithm { learning_rate: 0.2 target_tau: 0.2 batch_size: 3 } }
}
task { name: "hopper" kind: ONLINE config { env { name: "hopper" } } }
task {
  name: "hopper-medium" kind: OFFLINE record_command: "dbr dataset record --env hopper --quality medium --steps 1000"
  config { env { name: "hopper" } replay { seed_buffer { path: "hopper-medium.hdf5" } } }
}
contender {
  name: "dbr" task: "*"
  config { algorithm { target_tau: 0.3 batch_size: 4 dbr { epsilon: 0.1 constraint: FIXED } } }
  on { task: "connect*" config { algorithm { batch_size: 5 dbr { epsilon: 0.2 } } } }
  on { task: "*-medium" config { algorithm { sac {} } } }
}
contender { name: "sac" task: "hopper*" ablation_of: "dbr" config { algorithm { sac {} } } }
scale {
  name: "smoke" seeds: 2
  offline { learner { offline_updates: 7 max_updates: 7 } }
  online { launch { max_steps: 8 } }
  games { launch { max_episodes: 9 } algorithm { batch_size: 6 } }
}
scale {
  name: "paper"
  offline { learner { offline_updates: 70 max_updates: 70 } }
  online { launch { max_steps: 80 } }
  games { launch { max_episodes: 90 } }
}
)";

std::vector<std::string> NamesOf(const Grid& grid) {
  std::vector<std::string> names;
  for (const Cell& cell : grid.cells) names.push_back(cell.name());
  return names;
}

class GridTest : public testing::Test {
 protected:
  GridTest() { Touch(folder_ / "hopper-medium.hdf5"); }

  static void Touch(const std::string& path) { std::ofstream(path).put('x'); }

  GridOptions Options() const { return {.data = folder_.path(), .run_dir = folder_ / "run"}; }

  // The grid with each first text replaced by its second.
  static Experiment Changed(const std::vector<std::pair<std::string, std::string>>& changes) {
    std::string text = kGrid;
    for (const auto& [from, to] : changes) EXPECT_EQ(absl::StrReplaceAll({{from, to}}, &text), 1) << from;
    const auto experiment = ParseExperiment(text);
    EXPECT_TRUE(experiment.ok()) << experiment.status();
    return experiment.value_or(Experiment());
  }

  static std::vector<std::string> ErrorsOf(const Experiment& experiment, const GridOptions& options) {
    const absl::Status status = MakeCheckedGrid(experiment, options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << "accepted";
    std::vector<std::string> lines = absl::StrSplit(std::string(status.message()), "\n  ");
    if (lines.size() > 1) lines.erase(lines.begin());
    return lines;
  }
  std::vector<std::string> ErrorsOf(const std::vector<std::pair<std::string, std::string>>& changes) const {
    return ErrorsOf(Changed(changes), Options());
  }

  // Of the first seed's cells of the grid as it stands.
  Config ConfigOf(const std::string& name) const {
    const auto grid = MakeCheckedGrid(Changed({}), Options());
    EXPECT_TRUE(grid.ok()) << grid.status();
    for (const Cell& cell : grid->cells) {
      if (cell.name() == name) return cell.config;
    }
    ADD_FAILURE() << "no cell " << name;
    return Config();
  }

  const TempDir folder_;
};

TEST_F(GridTest, EachLayerOfAConfigWinsOverThoseBefore) {
  const Config config = ConfigOf("connect4/dbr/seed-1");
  EXPECT_EQ(config.algorithm().discount(), 0.5) << "base";
  EXPECT_EQ(config.algorithm().learning_rate(), 0.2) << "task";
  EXPECT_EQ(config.algorithm().target_tau(), 0.3) << "contender";
  EXPECT_EQ(config.algorithm().dbr().epsilon(), 0.2) << "contender on this task";
  EXPECT_EQ(config.algorithm().dbr().constraint(), DbrConfig::FIXED) << "contender, beside what differs here";
  EXPECT_EQ(config.algorithm().batch_size(), 6) << "scale";
  EXPECT_EQ(config.launch().max_episodes(), 9);
  EXPECT_EQ(config.launch().max_steps(), 0) << "of another kind of task";
  EXPECT_THAT(config.network().hidden_sizes(), ElementsAre(16, 8)) << "repeated fields add up";
}

TEST_F(GridTest, AnotherAlgorithmTakesThePlaceOfTheFirst) {
  EXPECT_TRUE(ConfigOf("hopper-medium/dbr/seed-1").algorithm().has_sac());
  EXPECT_TRUE(ConfigOf("hopper/dbr/seed-1").algorithm().has_dbr());
}

TEST_F(GridTest, WhatDiffersAtOneScaleHoldsThereAlone) {
  const Experiment experiment =
      Changed({{"on { task: \"connect*\"", "on { task: [\"hopper\", \"connect*\"] scale: \"paper\""}});
  GridOptions options = Options();
  auto grid = MakeCheckedGrid(experiment, options);
  ASSERT_TRUE(grid.ok()) << grid.status();
  EXPECT_EQ(grid->cells[0].config.algorithm().dbr().epsilon(), 0.1);
  options.scale = "paper";
  grid = MakeCheckedGrid(experiment, options);
  ASSERT_TRUE(grid.ok()) << grid.status();
  EXPECT_EQ(grid->cells[0].config.algorithm().dbr().epsilon(), 0.2);
  EXPECT_EQ(grid->cells[1].config.algorithm().dbr().epsilon(), 0.2) << "the other of its tasks";
  EXPECT_THAT(ErrorsOf({{"on { task: \"connect*\"", "on { scale: \"papr\""}}),
              ElementsAre("experiment 'tiny': contender 'dbr': on.scale: expected a scale of the grid, found "
                          "'papr'; did you mean 'paper'?"));
}

TEST_F(GridTest, SeedBuffersLieInTheDataFolder) {
  EXPECT_EQ(ConfigOf("hopper-medium/sac/seed-1").replay().seed_buffer().path(),
            folder_ / "hopper-medium.hdf5");
  EXPECT_EQ(ConfigOf("hopper/sac/seed-1").replay().seed_buffer().path(), "");
}

TEST_F(GridTest, EveryCellHasOneSeedBeforeAnyHasTwo) {
  const auto grid = MakeCheckedGrid(Changed({}), Options());
  ASSERT_TRUE(grid.ok()) << grid.status();
  EXPECT_THAT(NamesOf(*grid), ElementsAre("connect4/dbr/seed-1", "hopper/dbr/seed-1", "hopper/sac/seed-1",
                                          "hopper-medium/dbr/seed-1", "hopper-medium/sac/seed-1",
                                          "connect4/dbr/seed-2", "hopper/dbr/seed-2", "hopper/sac/seed-2",
                                          "hopper-medium/dbr/seed-2", "hopper-medium/sac/seed-2"));
  const Cell& last = grid->cells.back();
  EXPECT_EQ(last.config.seed(), 2);
  EXPECT_EQ(last.folder, folder_ / "run/hopper-medium/sac/seed-2");
  EXPECT_EQ(last.log(), folder_ / "run/hopper-medium/sac/seed-2.log");
  EXPECT_EQ(last.config_file(), folder_ / "run/hopper-medium/sac/seed-2.textproto");
}

TEST_F(GridTest, TheFirstScaleAndItsNumberOfSeedsUnlessToldOtherwise) {
  GridOptions options = Options();
  options.run_dir.clear();
  auto grid = MakeCheckedGrid(Changed({}), options);
  ASSERT_TRUE(grid.ok()) << grid.status();
  EXPECT_EQ(grid->scale, "smoke");
  EXPECT_EQ(grid->run_dir, "runs/tiny-smoke");
  options.scale = "paper";
  grid = MakeCheckedGrid(Changed({}), options);
  ASSERT_TRUE(grid.ok()) << grid.status();
  EXPECT_EQ(grid->cells.size(), 5 * 5) << "five seeds by default";
  EXPECT_EQ(grid->cells[0].config.launch().max_episodes(), 90);
  options.seeds = 1;
  EXPECT_EQ(MakeCheckedGrid(Changed({}), options)->cells.size(), 5);
}

TEST_F(GridTest, OnlyChoosesByTaskContenderPairAndCell) {
  const auto chosen = [&](std::vector<std::string> only) {
    GridOptions options = Options();
    options.only = std::move(only);
    const auto grid = MakeCheckedGrid(Changed({}), options);
    EXPECT_TRUE(grid.ok()) << grid.status();
    return grid.ok() ? NamesOf(*grid) : std::vector<std::string>();
  };
  EXPECT_THAT(chosen({"connect4"}), ElementsAre("connect4/dbr/seed-1", "connect4/dbr/seed-2"));
  EXPECT_THAT(chosen({"s?c"}), ElementsAre("hopper/sac/seed-1", "hopper-medium/sac/seed-1",
                                           "hopper/sac/seed-2", "hopper-medium/sac/seed-2"));
  EXPECT_THAT(chosen({"hopper-*/dbr"}), ElementsAre("hopper-medium/dbr/seed-1", "hopper-medium/dbr/seed-2"));
  EXPECT_THAT(chosen({"*/sac/seed-2", "connect4/*/seed-1"}),
              ElementsAre("connect4/dbr/seed-1", "hopper/sac/seed-2", "hopper-medium/sac/seed-2"));
}

TEST_F(GridTest, NamesAllThatIsWrongWithTheGridAtOnce) {
  EXPECT_THAT(
      ErrorsOf({{"name: \"hopper\" kind", "name: \"hop/per\" kind"},
                {"name: \"sac\" task: \"hopper*\"", "name: \"dbr\" task: [\"hoper-medium\", \"*\"]"},
                {"ablation_of: \"dbr\"", "ablation_of: \"dbrr\""},
                {"name: \"paper\"", "name: \"smoke\""},
                {"task: \"connect*\"", "task: \"chess\""}}),
      IsSupersetOf(
          {std::string("task 'hop/per': expected letters, digits, '.', '_', '+' and '-', since it names a "
                       "folder, beginning with a letter or digit"),
           std::string("contender 'dbr': expected each name once, found it again"),
           std::string("scale 'smoke': expected each name once, found it again"),
           std::string("contender 'dbr': task: expected a glob that matches a task, found 'hoper-medium'; "
                       "did you mean 'hopper-medium'?"),
           std::string("contender 'dbr': on.task: expected a glob that matches a task, found 'chess'; "
                       "known: connect4, hopper-medium")}));
}

TEST_F(GridTest, AnAblationNamesAnotherContender) {
  EXPECT_THAT(ErrorsOf({{"ablation_of: \"dbr\"", "ablation_of: \"dbrr\""}}),
              ElementsAre("experiment 'tiny': contender 'sac': ablation_of: expected another contender's "
                          "name, found 'dbrr'; did you mean 'dbr'?"));
  EXPECT_THAT(ErrorsOf({{"ablation_of: \"dbr\"", "ablation_of: \"sac\""}}),
              ElementsAre(HasSubstr("expected another contender's name, found 'sac'")));
}

TEST_F(GridTest, AContenderTakesPartInSomething) {
  EXPECT_THAT(ErrorsOf({{"name: \"sac\" task: \"hopper*\"", "name: \"sac\""}}),
              ElementsAre(HasSubstr("contender 'sac': task: expected the tasks that it takes part in, as "
                                    "globs, found none; \"*\" is all")));
}

TEST_F(GridTest, TheFolderOfWhatIsMovedAsideIsNoTask) {
  EXPECT_THAT(ErrorsOf({{"name: \"connect4\" kind", "name: \"aside\" kind"},
                        {"task: \"connect*\"", "task: \"aside\""}}),
              ElementsAre(HasSubstr("task 'aside': expected another name")));
}

TEST_F(GridTest, AGridWithoutScalesIsNone) {
  Experiment experiment = Changed({});
  experiment.clear_scale();
  EXPECT_THAT(ErrorsOf(experiment, Options()),
              ElementsAre(HasSubstr("scale: expected at least one, found none")));
}

TEST_F(GridTest, NamesUnknownScalesAndGlobsBesideTheRest) {
  GridOptions options = Options();
  options.scale = "smok";
  options.only = {"hopper", "haf-cheetah", "connec4"};
  EXPECT_THAT(
      ErrorsOf(Changed({{"ablation_of: \"dbr\"", "ablation_of: \"x\""}}), options),
      ElementsAre(StartsWith("contender 'sac': ablation_of"),
                  "--scale: expected a scale of the grid, found 'smok'; did you mean 'smoke'?",
                  "--only: expected a glob of TASK, CONTENDER, TASK/CONTENDER or TASK/CONTENDER/seed-N that "
                  "a cell answers to, found 'haf-cheetah'; known: connect4, hopper, hopper-medium, dbr, sac",
                  AllOf(StartsWith("--only"), HasSubstr("did you mean 'connect4'?"))));
}

TEST_F(GridTest, RefusesAnAlgorithmThatDoesNotServeATasksActions) {
  EXPECT_THAT(
      ErrorsOf({{"task: \"hopper*\"", "task: \"*\""}}),
      ElementsAre(AllOf(StartsWith("experiment 'tiny': task 'connect4', contender 'sac': "),
                        HasSubstr("discrete actions of environment 'connect4'"), HasSubstr("found sac"))));
}

TEST_F(GridTest, RefusesFieldsThatContradictEachOtherInACell) {
  EXPECT_THAT(ErrorsOf({{"epsilon: 0.1 constraint: FIXED", "epsilon: 0.1 max_repulsion: 3"},
                        {"batch_size: 5 dbr", "batch_size: 5 critics: 1 dbr"}}),
              testing::UnorderedElementsAre(
                  HasSubstr("task 'connect4', contender 'dbr': algorithm.dbr.max_repulsion: expected "
                            "repel_negative: true"),
                  HasSubstr("task 'connect4', contender 'dbr': algorithm.target_critics: expected at most "
                            "algorithm.critics (1)"),
                  HasSubstr("task 'hopper', contender 'dbr': algorithm.dbr.max_repulsion")))
      << "on hopper-medium the contender has no dbr";
}

TEST_F(GridTest, RefusesExplorationAndOpponentsThatDoNotFitTheTask) {
  EXPECT_THAT(
      ErrorsOf({{"env { name: \"connect4\" }", "env { name: \"connect4\" } actor { action_noise: 0.1 }"}}),
      ElementsAre(AllOf(HasSubstr("task 'connect4', contender 'dbr': "),
                        HasSubstr("actor.action_noise: expected 0"))));
  EXPECT_THAT(
      ErrorsOf({{"config { env { name: \"hopper\" } } }",
                 "config { env { name: \"hopper\" } evaluation { final_opponents: \"random\" } } }"}}),
      IsSupersetOf({AllOf(HasSubstr("task 'hopper', contender 'dbr': evaluation.final_opponents"),
                          HasSubstr("has no opponents"))}));
}

TEST_F(GridTest, ARowOfTheReportIsOfWhatThereIs) {
  const auto with_measure = [&](const std::string& measure) {
    return ErrorsOf(
        {{"name: \"connect4\" kind: GAMES", "name: \"connect4\" kind: GAMES measure { " + measure + " }"}});
  };
  EXPECT_THAT(with_measure("published { contender: \"dbrr\" mean: 1 }"),
              ElementsAre("experiment 'tiny': task 'connect4': measure.published.contender: expected a "
                          "contender's name, found 'dbrr'; did you mean 'dbr'?"));
  EXPECT_THAT(
      with_measure("opponent: \"mcts:11\""),
      ElementsAre(AllOf(HasSubstr("measure.opponent: expected one of the final evaluation's (random, "),
                        HasSubstr("found 'mcts:11'"))));
}

TEST_F(GridTest, RefusesAnUnknownEnvironment) {
  EXPECT_THAT(ErrorsOf({{"env { name: \"connect4\" }", "env { name: \"chess\" }"}}),
              ElementsAre(AllOf(HasSubstr("task 'connect4', contender 'dbr': "), HasSubstr("\"chess\""))));
}

TEST_F(GridTest, AnOfflineTaskHasASeedBufferAndNoActors) {
  EXPECT_THAT(
      ErrorsOf({{"replay { seed_buffer { path: \"hopper-medium.hdf5\" } }", ""}}),
      ElementsAre(
          "task 'hopper-medium', contender 'dbr': replay.seed_buffer.path: expected the seed buffer of "
          "an offline task, found none",
          StartsWith("task 'hopper-medium', contender 'sac': replay.seed_buffer.path")));
  EXPECT_THAT(
      ErrorsOf({{"offline_updates: 7 max_updates: 7", "offline_updates: 7 max_updates: 8"}}),
      IsSupersetOf({std::string(
          "task 'hopper-medium', contender 'dbr': expected an offline task to have "
          "learner.max_updates of 1 to learner.offline_updates, so that no actor acts, found 8 and 7")}));
}

TEST_F(GridTest, AFineTuningTaskHasASeedBufferAndActors) {
  const std::pair<std::string, std::string> kind = {"kind: OFFLINE", "kind: FINETUNE"},
                                            scale = {
                                                "scale {\n  name: \"smoke\" seeds: 2",
                                                "scale {\n  name: \"smoke\" seeds: 2\n  finetune { learner { "
                                                "offline_updates: 5 } launch { max_steps: 8 } }"};
  const auto grid = MakeCheckedGrid(Changed({kind, scale}), Options());
  ASSERT_TRUE(grid.ok()) << grid.status();
  for (const Cell& cell : grid->cells) {
    if (cell.task == "hopper-medium") EXPECT_EQ(cell.config.learner().offline_updates(), 5u) << "its scale's";
  }
  EXPECT_THAT(ErrorsOf({kind, scale, {"replay { seed_buffer { path: \"hopper-medium.hdf5\" } }", ""}}),
              Contains(HasSubstr("expected the seed buffer of a fine-tuning task, found none")));
  EXPECT_THAT(
      ErrorsOf({kind, scale, {"offline_updates: 5 }", "offline_updates: 5 max_updates: 5 }"}}),
      Contains(HasSubstr("expected a fine-tuning task to have actors, with learner.max_updates of 0 or "
                         "above learner.offline_updates, found 5 and 5")));
}

TEST_F(GridTest, EveryRunComesToAnEnd) {
  EXPECT_THAT(ErrorsOf({{"launch { max_episodes: 9 }", ""}}),
              ElementsAre(HasSubstr("task 'connect4', contender 'dbr': expected an end, found none: set "
                                    "learner.max_updates, launch.max_steps")));
}

TEST_F(GridTest, NamesMissingSeedBuffersOnceWithTheCommandThatMakesThem) {
  GridOptions options = Options();
  options.data = folder_ / "elsewhere";
  const std::string path = folder_ / "elsewhere/hopper-medium.hdf5";
  EXPECT_EQ(MakeCheckedGrid(Changed({}), options).status().message(),
            absl::StrCat("experiment 'tiny': task 'hopper-medium': expected its seed buffer, found no file '",
                         path, "'; make it with:\n    mkdir -p ", folder_ / "elsewhere",
                         " && dbr dataset record --env hopper --quality medium --steps 1000 --out ", path));
  options.only = {"hopper"};
  EXPECT_TRUE(MakeCheckedGrid(Changed({}), options).ok()) << "cells that are not chosen need none";
}

TEST_F(GridTest, ACellThatHasBegunNeedsItsSeedBufferNoMore) {
  GridOptions options = Options();
  options.only = {"hopper-medium/sac/seed-1"};
  const auto grid = MakeCheckedGrid(Changed({}), options);
  ASSERT_TRUE(grid.ok()) << grid.status();
  std::filesystem::remove(folder_ / "hopper-medium.hdf5");
  EXPECT_FALSE(MakeCheckedGrid(Changed({}), options).ok());
  std::filesystem::create_directories(grid->cells[0].folder);
  Touch(grid->cells[0].folder + "/config.textproto");
  EXPECT_TRUE(MakeCheckedGrid(Changed({}), options).ok());
}

TEST_F(GridTest, ACellThatWasKilledBeforeItHadAStoreNeedsItsSeedBuffer) {
  GridOptions options = Options();
  options.only = {"hopper-medium/sac/seed-1"};
  const auto grid = MakeCheckedGrid(Changed({}), options);
  ASSERT_TRUE(grid.ok()) << grid.status();
  std::filesystem::create_directories(grid->cells[0].folder);
  ASSERT_TRUE(
      WriteFileAtomically(grid->cells[0].folder + "/config.textproto", PrintConfig(grid->cells[0].config))
          .ok());
  std::filesystem::remove(folder_ / "hopper-medium.hdf5");
  EXPECT_THAT(std::string(MakeCheckedGrid(Changed({}), options).status().message()),
              HasSubstr("task 'hopper-medium': expected its seed buffer"));
}

TEST_F(GridTest, TakesFoldersOfAnyDepthAndName) {
  GridOptions options = Options();
  options.run_dir = folder_ / "a, run? " + std::string(200, 'x');
  const absl::Status status = MakeCheckedGrid(Changed({}), options).status();
  EXPECT_TRUE(status.ok()) << status;
}

TEST(ParseExperimentTest, ReportsEveryErrorOfTheTextWithItsPlace) {
  const absl::Status status = ParseExperiment(
                                  "name: \"x\"\ntask { nam: \"a\" config { env { nme: \"b\" } } }\n"
                                  "scale { name: \"s\" seeds: 0 online { learner { push_every: 0 } } }")
                                  .status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(StartsWith("experiment: 5 errors:\n"),
                    HasSubstr("2:8: task.nam: unknown field; did you mean 'name'?"),
                    HasSubstr("2:32: task.config.env.nme: unknown field; did you mean 'name'?"),
                    HasSubstr("task[0].name: expected a text, found an empty one"),
                    HasSubstr("scale[0].seeds: expected 1 to 1000, found 0"),
                    HasSubstr("scale[0].online.learner.push_every: expected at least 1, found 0")));
}

}  // namespace
}  // namespace dbr
