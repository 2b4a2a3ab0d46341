// Tests `dbr dataset` on the command line, as users call it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "core/run_folder.h"
#include "envs/env.h"
#include "envs/registry/registry.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/store/transition_store.h"
#include "tests/integration/dbr_process.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Json = nlohmann::json;

class DatasetProgramTest : public testing::Test {
 protected:
  std::pair<int, std::string> Dataset(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "dataset");
    return RunProgram("dbr", std::move(arguments));
  }

  Json Info(const std::string& path) const {
    const auto [status, output] = Dataset({"info", path, "--json"});
    EXPECT_EQ(status, 0) << output;
    EXPECT_TRUE(Json::accept(output)) << output;
    return Json::parse(output, nullptr, /*allow_exceptions=*/false);
  }

  void RecordRandom(const std::string& out, std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"record", "--env", "hopper", "--quality", "random", "--out", out};
    if (std::find(more.begin(), more.end(), "--steps") == more.end()) {
      arguments.insert(arguments.end(), {"--steps", "600"});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto [status, output] = Dataset(arguments);
    ASSERT_EQ(status, 0) << output;
  }

  int FilesInFolder() const {
    const std::filesystem::directory_iterator files(folder_.path());
    return static_cast<int>(std::distance(begin(files), end(files)));
  }

  const TempDir folder_;
};

TEST_F(DatasetProgramTest, RecordsTheSameStepsInBothLayouts) {
  RecordRandom(folder_ / "a.hdf5");
  RecordRandom(folder_ / "b.hdf5", {"--layout", "d4rl_pybullet"});
  RecordRandom(folder_ / "c.hdf5", {"--seed", "2"});
  Json a = Info(folder_ / "a.hdf5"), b = Info(folder_ / "b.hdf5");
  EXPECT_EQ(a["layout"], "d4rl");
  EXPECT_EQ(b["layout"], "d4rl_pybullet");
  EXPECT_EQ(a["rows"], 600);
  EXPECT_EQ(a["transitions"], 600);
  EXPECT_EQ(b["transitions"], 600);
  EXPECT_GT(b["rows"], 600);
  EXPECT_GT(a["episodes"], 5);
  for (const char* field : {"episodes", "terminals", "timeouts", "return"})
    EXPECT_EQ(a[field], b[field]) << field;
  EXPECT_NE(a["return"], Info(folder_ / "c.hdf5")["return"]);
}

TEST_F(DatasetProgramTest, ConvertsThereAndBackWithoutLoss) {
  RecordRandom(folder_ / "a.hdf5");
  auto [status, output] = Dataset({"convert", folder_ / "a.hdf5", "--layout", "d4rl", "--to", "d4rl_pybullet",
                                   "--out", folder_ / "b.hdf5"});
  ASSERT_EQ(status, 0) << output;
  std::tie(status, output) =
      Dataset({"convert", folder_ / "b.hdf5", "--to", "d4rl", "--out", folder_ / "c.hdf5"});
  ASSERT_EQ(status, 0) << output;
  EXPECT_TRUE(ReadFile(folder_ / "a.hdf5").value() == ReadFile(folder_ / "c.hdf5").value());
}

TEST_F(DatasetProgramTest, BadUsageIsSaidInOneLineAndLeavesNoFile) {
  const std::string out = folder_ / "out.hdf5";
  const auto refused = [&](std::vector<std::string> arguments, int expected_status) {
    const auto [status, output] = Dataset(std::move(arguments));
    EXPECT_EQ(status, expected_status) << output;
    return output;
  };
  const auto record = [&](const std::string& quality, std::vector<std::string> more) {
    more.insert(more.begin(), {"record", "--env", "hopper", "--out", out, "--quality", quality});
    return more;
  };
  EXPECT_THAT(refused(record("good", {"--steps", "10"}), 2), HasSubstr("random, medium, mixture or mixed"));
  EXPECT_THAT(refused(record("random", {}), 2), HasSubstr("--steps"));
  EXPECT_THAT(refused(record("mixed", {}), 2),
              HasSubstr("dbr launch deploy/configs/hopper_medium.textproto"));
  EXPECT_THAT(refused(record("random", {"--steps", "10", "--layout", "minari"}), 2),
              HasSubstr("d4rl_pybullet"));
  EXPECT_THAT(refused(record("medium", {"--steps", "10", "--policy", folder_ / "none"}), 1),
              HasSubstr("none"));
  EXPECT_THAT(refused(record("mixture", {"--steps", "10", "--policy", "a"}), 2),
              HasSubstr("two policies or more with --quality mixture, found 1"));
  EXPECT_THAT(
      refused(record("mixture", {"--steps", "10", "--policy", "a", "--policy", "b", "--share", "1"}), 2),
      HasSubstr("--share: expected one for each of the 2 policies, or none, found 1"));
  EXPECT_THAT(refused(record("medium", {"--steps", "10", "--policy", "a", "--policy", "b"}), 2),
              HasSubstr("--quality mixture for several"));
  EXPECT_THAT(refused(record("random", {"--steps", "10", "--acting", "sample"}), 2), HasSubstr("--acting"));
  EXPECT_THAT(refused(record("random", {"--steps", "10", "--share", "1"}), 2), HasSubstr("--share"));
  const std::string ant = absl::StrCat(DBR_SOURCE_DIR, "/deploy/policies/ant_medium.safetensors");
  const std::string hopper = absl::StrCat(DBR_SOURCE_DIR, "/deploy/policies/hopper_medium.safetensors");
  EXPECT_THAT(refused(record("mixture", {"--steps", "10", "--policy", hopper, "--policy", ant}), 2),
              AllOf(HasSubstr(absl::StrCat("--policy ", ant)), HasSubstr("hopper")));
  EXPECT_THAT(refused({"record", "--env", "hoper", "--quality", "random", "--steps", "10", "--out", out}, 2),
              HasSubstr("unknown environment"));
  EXPECT_THAT(refused({"info", folder_ / "none.hdf5", "--layout", "d4rl"}, 1), HasSubstr("none.hdf5"));
  EXPECT_THAT(refused({"info", out, "--layout", "rlds"}, 2), HasSubstr("d4rl, d4rl_pybullet or minari"));
  EXPECT_EQ(FilesInFolder(), 0);
}

TEST_F(DatasetProgramTest, ANamedPipeIsRefusedAtOnce) {
  const std::string pipe = folder_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const auto [status, output] = Dataset({"info", pipe, "--layout", "d4rl"});
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output, HasSubstr("expected a file, found a pipe"));
}

TEST_F(DatasetProgramTest, CtrlCStopsARecordingAndLeavesNothing) {
  DbrProcess process("dbr", {"dataset", "record", "--env", "hopper", "--quality", "random", "--steps",
                             "100000000", "--out", folder_ / "out.hdf5"});
  ASSERT_TRUE(process.Await([&] { return FilesInFolder() > 0; })) << process.output();
  process.Signal(SIGINT);
  EXPECT_EQ(process.Wait(), 130) << process.output();
  EXPECT_EQ(FilesInFolder(), 0);
}

TEST_F(DatasetProgramTest, AMixtureHasThePoliciesSharesOfTheSteps) {
  const std::string out = folder_ / "out.hdf5", alone = folder_ / "alone.hdf5";
  const std::string policy = absl::StrCat(DBR_SOURCE_DIR, "/deploy/policies/hopper_medium.safetensors");
  const auto record = [&](const std::string& file, std::vector<std::string> more) {
    more.insert(more.begin(), {"record", "--env", "hopper", "--out", file, "--policy", policy});
    const auto [status, output] = Dataset(std::move(more));
    EXPECT_EQ(status, 0) << output;
    return output;
  };
  EXPECT_THAT(record(out, {"--quality", "mixture", "--policy", policy, "--share", "1", "--share", "3",
                           "--steps", "2000", "--acting", "sample"}),
              HasSubstr("transitions  2,000"));
  record(alone, {"--quality", "medium", "--steps", "500", "--acting", "sample"});
  const auto rewards = [](const std::string& file) {
    const auto reader = DatasetReader::Open(file, {.layout = DatasetLayout::kD4rl});
    EXPECT_TRUE(reader.ok()) << reader.status();
    TransitionChunk chunk((*reader)->transition_layout(), 4000);
    std::vector<float> all;
    for (int size = *(*reader)->Next(&chunk); size > 0; size = *(*reader)->Next(&chunk)) {
      for (int i = 0; i < size; ++i) all.push_back(chunk.row(i)[chunk.layout.reward_offset()]);
    }
    return all;
  };
  const std::vector<float> mixture = rewards(out), first = rewards(alone);
  ASSERT_EQ(first.size(), 500u);
  ASSERT_EQ(mixture.size(), 2000u);
  EXPECT_TRUE(std::equal(first.begin(), first.end(), mixture.begin()))
      << "the first policy's part comes first";
  EXPECT_FALSE(std::equal(first.begin(), first.end(), mixture.begin() + 500))
      << "parts have seeds of their own";
}

TEST_F(DatasetProgramTest, RecordsAllThatARunSaw) {
  const RunFolder run{folder_.path()};
  ASSERT_TRUE(WriteFileAtomically(run.config(), "env { name: \"hopper\" } replay { capacity: 1000 }").ok());
  const auto env = MakeEnv({.name = "hopper", .opponents = {}});
  ASSERT_TRUE(env.ok()) << env.status();
  const EnvSpec& spec = (*env)->spec();
  {
    auto store = TransitionStore::Open({.path = run.replay_store(),
                                        .env = spec.name,
                                        .layout = TransitionLayout::Of(spec),
                                        .capacity = 1000});
    ASSERT_TRUE(store.ok()) << store.status();
    ASSERT_TRUE((*store)->writers().Open({.id = 1, .name = "actor"}).ok());
    std::vector<float> observation(spec.observation_size), next = observation;
    const std::vector<float> action(spec.actions.width(), 0.5f);
    (*env)->Reset(1, absl::MakeSpan(observation), {});
    for (bool done = false; !done; observation = next) {
      const StepResult result = (*env)->Step(action, absl::MakeSpan(next), {});
      done = result.done();
      (*store)->Append({.observation = observation,
                        .action = action,
                        .mask = {},
                        .reward = result.reward,
                        .discount = result.terminated ? 0.0f : 0.99f,
                        .next_observation = next,
                        .next_mask = {}},
                       {});
    }
  }
  std::vector<std::string> arguments = {"record", "--env",  "hopper", "--quality",           "mixed",
                                        "--run",  run.root, "--out",  folder_ / "mixed.hdf5"};
  auto [status, output] = Dataset(arguments);
  ASSERT_EQ(status, 0) << output;
  const Json info = Info(folder_ / "mixed.hdf5");
  EXPECT_EQ(info["episodes"], 1);
  EXPECT_GT(info["transitions"], 1);
  arguments[2] = "ant";
  std::tie(status, output) = Dataset(arguments);
  EXPECT_EQ(status, 2);
  EXPECT_THAT(output, AllOf(HasSubstr("run of ant"), HasSubstr("one of hopper")));
}

}  // namespace
}  // namespace dbr
