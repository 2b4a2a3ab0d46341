// The conformance suite over every environment of the registry, alone and with each of its opponents.
#include "tests/envs/conformance.h"

#include <string>
#include <vector>

#include "core/symmetry.h"
#include "envs/registry/registry.h"
#include "gtest/gtest.h"

namespace dbr::conformance {
namespace {

std::vector<EnvOptions> AllOptions() {
  std::vector<EnvOptions> all;
  for (const std::string& name : EnvNames()) {
    all.push_back({.name = name, .opponents = {}});
    const std::vector<std::string> opponents = EvaluationOpponents(name);
    for (const std::string& opponent : opponents) all.push_back({.name = name, .opponents = {opponent}});
    if (opponents.size() > 1) all.push_back({.name = name, .opponents = opponents});
  }
  return all;
}

class EnvConformance : public testing::TestWithParam<EnvOptions> {};

TEST_P(EnvConformance, TheSpecIsComplete) {
  World world(GetParam());
  const EnvSpec& spec = world.spec();
  EXPECT_EQ(spec.name, GetParam().name);
  EXPECT_GT(spec.observation_size, 0);
  EXPECT_GT(spec.actions.size, spec.actions.discrete() ? 1 : 0);
  EXPECT_GT(spec.max_episode_steps, 0);
  const absl::Status symmetry = CheckSymmetry(spec.symmetry, spec.observation_size, spec.actions.size);
  EXPECT_TRUE(symmetry.ok() || spec.symmetry.empty()) << symmetry;
  EXPECT_EQ(spec, World(GetParam()).spec());
}

TEST_P(EnvConformance, EveryStepWritesAllOfItsMemoryAndSaneResults) {
  World world(GetParam());
  Rng rng(3);
  for (std::uint64_t seed = 0; seed < EnoughEpisodes(world.spec()); ++seed) {
    world.Reset(seed);
    ExpectWellWritten(world, false);
    for (bool done = false; !done;) {
      const StepResult result = world.Step(rng);
      done = result.done();
      ExpectWellWritten(world, done);
      ExpectSaneResult(world.spec(), result);
    }
  }
}

TEST_P(EnvConformance, EpisodesEndWithinTheStepLimit) {
  World world(GetParam());
  for (std::uint64_t seed = 0; seed < EnoughEpisodes(world.spec()); ++seed) {
    const Episode episode = PlayEpisode(world, seed);
    EXPECT_TRUE(episode.results.back().done());
    EXPECT_LE(episode.results.size(), world.spec().max_episode_steps);
  }
}

TEST_P(EnvConformance, TheSameSeedGivesTheSameEpisode) {
  World fresh(GetParam());
  World used(GetParam());
  for (std::uint64_t seed = 100; seed < 100 + EnoughEpisodes(fresh.spec()); ++seed) {
    PlayEpisode(used, seed + 1000);
    ExpectSameEpisode(PlayEpisode(fresh, seed), PlayEpisode(used, seed));
  }
}

TEST_P(EnvConformance, AResetInTheMiddleOfAnEpisodeLeavesNothingBehind) {
  World world(GetParam());
  const Episode whole = PlayEpisode(world, 7);
  Rng rng(5);
  world.Reset(8);
  world.Step(rng);
  ExpectSameEpisode(whole, PlayEpisode(world, 7));
}

TEST_P(EnvConformance, InterleavedWorldsDoNotInfluenceEachOther) {
  World first(GetParam());
  World second(GetParam());
  const Episode expected = PlayEpisode(first, 21);
  Rng rng(22);
  first.Reset(21);
  second.Reset(22);
  bool second_done = false;
  for (std::size_t step = 0; step < expected.actions.size(); ++step) {
    EXPECT_EQ(first.Seen(), expected.seen[step]);
    if (second_done) second.Reset(23 + step);
    second_done = second.Step(rng).done();
    EXPECT_EQ(first.StepWith(expected.actions[step]).reward, expected.results[step].reward);
  }
  EXPECT_EQ(first.Seen(), expected.seen.back());
}

using EnvConformanceDeathTest = EnvConformance;

TEST_P(EnvConformanceDeathTest, AnActionThatIsNoneOrIsMaskedIsAProgrammersMistake) {
  World world(GetParam());
  if (!world.spec().actions.discrete()) GTEST_SKIP() << "a box has no mask";
  world.Reset(1);
  const float size = static_cast<float>(world.spec().actions.size);
  for (const float none : {-1.0f, size, 0.5f, std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_DEATH(world.StepWith({none}), "check failed") << none;
  }
  Rng rng(6);
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    world.Reset(seed);
    for (bool done = false; !done;) {
      const absl::Span<float> mask = world.mask();
      for (std::size_t action = 0; action < mask.size(); ++action) {
        if (mask[action] == 1.0f) continue;
        EXPECT_DEATH(world.StepWith({static_cast<float>(action)}), "check failed");
        return;
      }
      done = world.Step(rng).done();
    }
  }
}

TEST_P(EnvConformanceDeathTest, AStepNeedsARunningEpisode) {
  World world(GetParam());
  const std::vector<float> action(world.spec().actions.width(), 0.0f);
  EXPECT_DEATH(world.StepWith(action), "check failed");
  PlayEpisode(world, 1);
  EXPECT_DEATH(world.StepWith(action), "check failed");
}

std::string TestName(const testing::TestParamInfo<EnvOptions>& info) {
  std::string name = info.param.name;
  for (const std::string& opponent : info.param.opponents) name += "_" + opponent;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Registry, EnvConformance, testing::ValuesIn(AllOptions()), TestName);
INSTANTIATE_TEST_SUITE_P(Registry, EnvConformanceDeathTest, testing::ValuesIn(AllOptions()), TestName);

}  // namespace
}  // namespace dbr::conformance
