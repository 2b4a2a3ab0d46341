// Asking servers: readiness, and the state of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "absl/synchronization/notification.h"
#include "core/file_io.h"
#include "core/run_folder.h"
#include "deploy/cli/common_options.h"
#include "deploy/launch/evaluation_feed.h"
#include "deploy/launch/health.h"
#include "deploy/launch/monitor.h"
#include "deploy/launch/run_access.h"
#include "proto/config/config_file.h"
#include "proto/policy.grpc.pb.h"
#include "proto/replay.grpc.pb.h"
#include "proto/rpc/protocol.h"
#include "proto/rpc/server.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr absl::Duration kLong = absl::Seconds(60);  // reached only where something is wrong

// A replay and a learner that answer with fixed figures.
class FixedReplay : public Replay::Service {
 public:
  grpc::Status Stats(grpc::ServerContext*, const StatsRequest*, StatsReply* reply) override {
    reply->set_inserted(77);
    reply->set_protocol_version(kProtocolVersion);
    return grpc::Status::OK;
  }
};
class FixedLearner : public Policy::Service {
 public:
  grpc::Status Status(grpc::ServerContext*, const LearnerStatusRequest* have, LearnerStatus* reply) override {
    reply->set_updates(5);
    reply->set_protocol_version(protocol_version);
    absl::MutexLock lock(&mutex);
    reply->set_life(life);
    reply->set_newest_report(reports.size());
    for (std::size_t i = have->life() == life ? have->newest_report() : 0; i < reports.size(); ++i)
      *reply->add_reports() = reports[i];
    return grpc::Status::OK;
  }
  void Report(std::uint64_t version) {
    absl::MutexLock lock(&mutex);
    reports.emplace_back().set_policy_version(version);
  }
  // As a learner that was started again.
  void LiveAgain() {
    absl::MutexLock lock(&mutex);
    ++life;
    reports.clear();
  }

  absl::Mutex mutex;
  std::uint64_t life = 41;
  std::vector<EvaluationReport> reports;

  std::uint32_t protocol_version = kProtocolVersion;
};

TEST(HealthCheckTest, AnswersWhenTheServerServes) {
  TempDir folder;
  const std::string address = absl::StrCat("unix:", folder / "s");
  FixedReplay replay;
  absl::Notification answered;
  const HealthCheck check(address, kLong, [&] { answered.Notify(); });
  EXPECT_FALSE(check.result().has_value());
  const auto server = StartServer({.address = address}, {&replay});
  ASSERT_TRUE(server.ok()) << server.status();
  answered.WaitForNotification();
  EXPECT_TRUE(check.result()->ok()) << *check.result();
}

TEST(HealthCheckTest, NamesTheAddressThatDoesNotAnswer) {
  TempDir folder;
  absl::Notification answered;
  const HealthCheck check(absl::StrCat("unix:", folder / "s"), absl::Milliseconds(50),
                          [&] { answered.Notify(); });
  answered.WaitForNotification();
  EXPECT_EQ(check.result()->code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(std::string(check.result()->message()), HasSubstr(folder.path()));
}

TEST(HealthCheckTest, TellsAServerThatAnswersFromOneThatServes) {
  TempDir folder;
  const std::string address = absl::StrCat("unix:", folder / "s");
  FixedReplay replay;
  const auto server = StartServer({.address = address}, {&replay});
  ASSERT_TRUE(server.ok()) << server.status();
  server->server->GetHealthCheckService()->SetServingStatus(false);
  absl::Notification answered;
  const HealthCheck check(address, kLong, [&] { answered.Notify(); });
  answered.WaitForNotification();
  EXPECT_EQ(check.result()->code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(check.result()->message()), HasSubstr("not serving"));
}

TEST(HealthCheckTest, EndsWhenItIsNoLongerWanted) {
  TempDir folder;
  const HealthCheck check(absl::StrCat("unix:", folder / "s"), absl::InfiniteDuration(), [] {});
}

TEST(RunMonitorTest, KeepsTheNewestAnswersWhileAServiceIsAway) {
  TempDir folder;
  const std::string replay_address = absl::StrCat("unix:", folder / "r");
  const std::string learner_address = absl::StrCat("unix:", folder / "l");
  FixedReplay replay;
  FixedLearner learner;
  auto replay_server = StartServer({.address = replay_address}, {&replay});
  auto learner_server = StartServer({.address = learner_address}, {&learner});
  ASSERT_TRUE(replay_server.ok() && learner_server.ok());
  absl::Notification sampled;
  RunMonitor monitor(replay_address, learner_address, absl::Hours(1), [&] { sampled.Notify(); });
  sampled.WaitForNotification();
  RunSample sample = monitor.Take();
  ASSERT_TRUE(sample.replay.has_value() && sample.learner.has_value());
  EXPECT_EQ(sample.replay->inserted(), 77);
  EXPECT_EQ(sample.learner->updates(), 5);
  EXPECT_FALSE(sample.replay_away || sample.learner_away);

  learner_server->server->Shutdown();
  learner_server->server.reset();
  sample = monitor.Ask(absl::Seconds(5));
  EXPECT_TRUE(sample.learner_away);
  EXPECT_EQ(sample.learner->updates(), 5);
  EXPECT_FALSE(sample.replay_away);
}

TEST(RunMonitorTest, HandsOverEachReportOnceHoweverManyCameBetweenTwoSamples) {
  TempDir folder;
  const std::string replay_address = absl::StrCat("unix:", folder / "r");
  const std::string learner_address = absl::StrCat("unix:", folder / "l");
  FixedReplay replay;
  FixedLearner learner;
  const auto replay_server = StartServer({.address = replay_address}, {&replay});
  const auto learner_server = StartServer({.address = learner_address}, {&learner});
  ASSERT_TRUE(replay_server.ok() && learner_server.ok());
  RunMonitor monitor(replay_address, learner_address, absl::ZeroDuration(), [] {});
  std::vector<std::uint64_t> taken, expected;
  const auto take = [&taken](const RunSample& sample) {
    for (const EvaluationReport& report : sample.reports) taken.push_back(report.policy_version());
  };
  // The monitor asks all the time, and so do we: whoever is answered first must not make the other one count
  // a report again.
  for (std::uint64_t version = 1; version <= 60; ++version) {
    learner.Report(version);
    expected.push_back(version);
    if (version % 3 == 0) take(monitor.Ask(kLong));
    if (version % 5 == 0) take(monitor.Take());
    if (version % 20 != 0) continue;
    take(monitor.Ask(kLong));
    learner.LiveAgain();
  }
  take(monitor.Ask(kLong));
  EXPECT_EQ(taken, expected);
  EXPECT_EQ(monitor.Take().missed_reports, 0u);
}

TEST(EvaluationFeedTest, AnAnswerToAnOlderQuestionAddsNothingTwice) {
  const auto answer = [](std::uint64_t life, std::uint64_t first, std::uint64_t last) {
    LearnerStatus status;
    status.set_life(life);
    status.set_newest_report(last);
    for (std::uint64_t i = first; i <= last; ++i) status.add_reports()->set_policy_version(i);
    return status;
  };
  EvaluationFeed feed;
  const auto taken = [&feed] {
    std::vector<std::uint64_t> versions;
    for (const EvaluationReport& report : feed.Take()) versions.push_back(report.policy_version());
    return versions;
  };
  feed.Read(answer(1, 1, 3));
  feed.Read(answer(1, 1, 2));
  feed.Read(answer(1, 3, 4));
  EXPECT_THAT(taken(), ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(feed.have().life(), 1u);
  EXPECT_EQ(feed.have().newest_report(), 4u);
  feed.Read(answer(2, 1, 2));  // the next life counts from 1
  EXPECT_THAT(taken(), ElementsAre(1, 2));
  EXPECT_EQ(feed.missed(), 0u);
  feed.Read(answer(2, 10, 11));  // 3 to 9 were dropped
  EXPECT_THAT(taken(), ElementsAre(10, 11));
  EXPECT_EQ(feed.missed(), 7u);
  feed.Read(answer(2, 12, 11));
  EXPECT_EQ(feed.missed(), 7u);
}

TEST(RunMonitorTest, KeepsTheRefusalOfAServiceOfAnotherProtocol) {
  TempDir folder;
  const std::string replay_address = absl::StrCat("unix:", folder / "r");
  const std::string learner_address = absl::StrCat("unix:", folder / "l");
  FixedReplay replay;
  FixedLearner learner;
  learner.protocol_version = 0;
  const auto replay_server = StartServer({.address = replay_address}, {&replay});
  const auto learner_server = StartServer({.address = learner_address}, {&learner});
  ASSERT_TRUE(replay_server.ok() && learner_server.ok());
  absl::Notification sampled;
  RunMonitor monitor(replay_address, learner_address, absl::ZeroDuration(), [&] { sampled.Notify(); });
  sampled.WaitForNotification();  // which would end the test if there were a second round
  const RunSample sample = monitor.Take();
  EXPECT_EQ(sample.refusal.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(sample.refusal.message()),
              AllOf(HasSubstr(learner_address), HasSubstr("the learner is older than this program")));
  EXPECT_EQ(sample.replay->inserted(), 77);
}

TEST(ReplayAddressTest, TakesAddressesAndRunFolders) {
  TempDir folder;
  EXPECT_EQ(*ReplayAddress("unix:some/replay.sock"), "unix:some/replay.sock");
  EXPECT_EQ(*ReplayAddress("127.0.0.1:7000"), "127.0.0.1:7000");
  for (const char* none : {"nothing", "127.0.0.1:99999", "127.0.0.1:0", "unix:"}) {
    const absl::Status status = ReplayAddress(none).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << none;
    EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("--replay: "), HasSubstr(none)));
  }
  EXPECT_EQ(ReplayAddress(folder.path()).status().code(), absl::StatusCode::kNotFound);
  ASSERT_TRUE(WriteFileAtomically(RunFolder{folder.path()}.config(), PrintConfig(Config())).ok());
  EXPECT_EQ(*ReplayAddress(folder.path()), absl::StrCat("unix:", folder.path(), "/replay.sock"));
  ASSERT_TRUE(
      WriteFileAtomically(RunFolder{folder.path()}.config(), "replay { address: '127.0.0.1:7001' }").ok());
  EXPECT_EQ(*ReplayAddress(folder.path()), "127.0.0.1:7001");
}

TEST(OpenPolicyTest, NamesTheFileThatCannotBeRead) {
  TempDir folder;
  EXPECT_THAT(std::string(OpenPolicy(folder.path()).status().message()),
              HasSubstr("policy/latest.safetensors"));
  EXPECT_EQ(OpenPolicy(folder / "none").status().code(), absl::StatusCode::kNotFound);
  ASSERT_TRUE(WriteFileAtomically(folder / "damaged.safetensors", "not a policy at all").ok());
  const absl::Status damaged = OpenPolicy(folder / "damaged.safetensors").status();
  EXPECT_EQ(damaged.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(damaged.message()), HasSubstr("damaged.safetensors"));
}

TEST(ParseActingModeTest, TakesAnyCaseAndNamesTheModes) {
  EXPECT_EQ(*ParseActingMode("greedy_q"), GREEDY_Q);
  EXPECT_EQ(*ParseActingMode("Support"), SUPPORT);
  EXPECT_THAT(std::string(ParseActingMode("best").status().message()),
              HasSubstr("sample, mode, greedy_q or support"));
}

}  // namespace
}  // namespace dbr
