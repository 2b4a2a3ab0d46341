// Recording on several threads: the same steps, in the same order, whoever plays them.
#include "deploy/record/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <vector>

#include "core/rng.h"
#include "envs/registry/registry.h"
#include "nn/mlp.h"

namespace dbr {
namespace {

using testing::HasSubstr;

std::shared_ptr<const PolicyNetworks> RandomPolicy(const std::string& env_name) {
  const auto env = MakeEnv({.name = env_name, .opponents = {}});
  PolicySnapshot snapshot;
  snapshot.version = 1;
  snapshot.spec = {.env = (*env)->spec().name,
                   .algorithm = "sac",
                   .observation_size = (*env)->spec().observation_size,
                   .actions = (*env)->spec().actions,
                   .hidden_sizes = {16}};
  std::vector<float> parameters(PolicyShape(snapshot.spec).parameter_count());
  Rng rng(7);
  for (float& value : parameters) value = 0.2f * static_cast<float>(rng.Normal());
  snapshot.networks = {{kPolicyNetwork, parameters}};
  auto policy = PolicyNetworks::Create(snapshot);
  EXPECT_TRUE(policy.ok()) << policy.status();
  return *policy;
}

struct Recorded {
  std::vector<EpisodeRows> episodes;
  std::int64_t steps = 0;
  std::int64_t progress = 0;
};

absl::StatusOr<Recorded> Record(const RecordOptions& options) {
  Recorded recorded;
  const RecordSinks sinks = {.episode =
                                 [&](const EpisodeView& view) {
                                   EpisodeRows rows;
                                   rows.AddObservation(view.observations);
                                   rows.actions.assign(view.actions.begin(), view.actions.end());
                                   rows.rewards.assign(view.rewards.begin(), view.rewards.end());
                                   rows.ending = view.ending;
                                   recorded.steps += rows.steps();
                                   recorded.episodes.push_back(rows);
                                   return absl::OkStatus();
                                 },
                             .progress = [&](std::int64_t steps) { recorded.progress = steps; }};
  const std::atomic<bool> cancelled = false;
  const absl::Status status = RecordEpisodes(options, sinks, cancelled);
  if (!status.ok()) return status;
  return recorded;
}

void ExpectSame(const Recorded& a, const Recorded& b) {
  ASSERT_EQ(a.episodes.size(), b.episodes.size());
  for (std::size_t i = 0; i < a.episodes.size(); ++i) {
    EXPECT_EQ(a.episodes[i].observations, b.episodes[i].observations) << i;
    EXPECT_EQ(a.episodes[i].actions, b.episodes[i].actions) << i;
    EXPECT_EQ(a.episodes[i].rewards, b.episodes[i].rewards) << i;
    EXPECT_EQ(a.episodes[i].ending, b.episodes[i].ending) << i;
  }
}

TEST(RecorderTest, TheNumberOfThreadsChangesNothing) {
  for (const bool with_policy : {false, true}) {
    RecordOptions options{.env = "hopper", .policy = nullptr, .steps = 3000, .seed = 3, .threads = 1};
    if (with_policy) options.policy = RandomPolicy("hopper");
    if (with_policy) options.acting = SAMPLE;
    const absl::StatusOr<Recorded> one = Record(options);
    ASSERT_TRUE(one.ok()) << one.status();
    options.threads = 3;
    const absl::StatusOr<Recorded> three = Record(options);
    ASSERT_TRUE(three.ok()) << three.status();
    ExpectSame(*one, *three);
    options.seed = 4;
    const absl::StatusOr<Recorded> other = Record(options);
    ASSERT_TRUE(other.ok()) << other.status();
    EXPECT_NE(one->episodes[0].observations, other->episodes[0].observations);
  }
}

TEST(RecorderTest, APolicyThatSamplesDoesOtherThanItsMean) {
  RecordOptions options{.env = "hopper", .policy = RandomPolicy("hopper"), .steps = 400, .seed = 3};
  const absl::StatusOr<Recorded> mode = Record(options), again = Record(options);
  options.acting = SAMPLE;
  const absl::StatusOr<Recorded> sampled = Record(options);
  ASSERT_TRUE(mode.ok() && again.ok() && sampled.ok()) << mode.status() << sampled.status();
  ExpectSame(*mode, *again);
  EXPECT_NE(mode->episodes[0].actions, sampled->episodes[0].actions);
  EXPECT_NE(sampled->episodes[0].actions, sampled->episodes[1].actions);
}

TEST(RecorderTest, GivesExactlyTheStepsAskedForInWholeEpisodesButForTheLast) {
  const absl::StatusOr<Recorded> recorded =
      Record({.env = "hopper", .policy = nullptr, .steps = 500, .seed = 1, .threads = 2});
  ASSERT_TRUE(recorded.ok()) << recorded.status();
  EXPECT_EQ(recorded->steps, 500);
  EXPECT_EQ(recorded->progress, 500);
  const auto env = MakeEnv({.name = "hopper", .opponents = {}});
  const EnvSpec& spec = (*env)->spec();
  for (std::size_t i = 0; i < recorded->episodes.size(); ++i) {
    const EpisodeRows& episode = recorded->episodes[i];
    ASSERT_EQ(episode.observations.size(), (episode.rewards.size() + 1) * spec.observation_size);
    ASSERT_EQ(episode.actions.size(), episode.rewards.size() * spec.actions.width());
    const bool last = i + 1 == recorded->episodes.size();
    EXPECT_TRUE(last || episode.ending != EpisodeEnding::kUnfinished);
    for (const float action : episode.actions) EXPECT_LE(std::abs(action), 1);
  }
}

TEST(RecorderTest, CutsTheCheetahAtItsTimeLimit) {
  const absl::StatusOr<Recorded> recorded =
      Record({.env = "half_cheetah", .policy = nullptr, .steps = 1500, .seed = 1, .threads = 2});
  ASSERT_TRUE(recorded.ok()) << recorded.status();
  ASSERT_EQ(recorded->episodes.size(), 2);
  EXPECT_EQ(recorded->episodes[0].steps(), 1000);
  EXPECT_EQ(recorded->episodes[0].ending, EpisodeEnding::kTimeLimit);
  EXPECT_EQ(recorded->episodes[1].ending, EpisodeEnding::kUnfinished);
}

TEST(RecorderTest, RefusesWhatDoesNotFit) {
  const auto message = [](const RecordOptions& options) {
    const absl::Status status = Record(options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_THAT(message({.env = "hoper", .policy = nullptr, .steps = 10}), HasSubstr("unknown environment"));
  EXPECT_THAT(message({.env = "connect4", .policy = nullptr, .steps = 10}), HasSubstr("continuous actions"));
  EXPECT_THAT(message({.env = "ant", .policy = RandomPolicy("hopper"), .steps = 10}), HasSubstr("hopper"));
}

TEST(RecorderTest, StopsWhenCancelledAndWhenTheSinkFails) {
  const std::atomic<bool> cancelled = true;
  const RecordSinks sinks = {.episode = [](const EpisodeView&) { return absl::DataLossError("disk"); },
                             .progress = [](std::int64_t) {}};
  const RecordOptions options{.env = "hopper", .policy = nullptr, .steps = 100000, .threads = 2};
  EXPECT_EQ(RecordEpisodes(options, sinks, cancelled).code(), absl::StatusCode::kCancelled);
  const std::atomic<bool> not_cancelled = false;
  EXPECT_EQ(RecordEpisodes(options, sinks, not_cancelled).code(), absl::StatusCode::kDataLoss);
}

}  // namespace
}  // namespace dbr
