// Tests the policy service over a real socket: slow subscribers get the newest snapshot and none in between.
#include "learner/runtime/policy_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/rpc/channel.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/learner_client.h"
#include "proto/rpc/protocol.h"
#include "proto/rpc/server.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

PolicySnapshot Snapshot(std::uint64_t version) {
  PolicySnapshot snapshot;
  snapshot.version = version;
  snapshot.updates = 10 * version;
  snapshot.spec = {"test", "dbr", 1, {ActionKind::kDiscrete, 2}, {}};
  snapshot.networks = {{kPolicyNetwork, {static_cast<float>(version), 2, 3, 4}}};
  return snapshot;
}

SubscribeRequest Opening(std::uint32_t protocol_version = kProtocolVersion) {
  SubscribeRequest request;
  request.set_subscriber("actor-0");
  request.set_protocol_version(protocol_version);
  return request;
}

class PolicyServiceTest : public testing::Test {
 protected:
  // No subscription looks for its reader within a test: what wakes it is what the test does.
  PolicyServiceTest()
      : service_([this](const EvaluationReport& report) { reports_.push_back(report); }, absl::Minutes(1)) {
    auto running = StartServer({"unix:" + folder_.path() + "/learner.sock"}, {&service_});
    EXPECT_TRUE(running.ok()) << running.status();
    running_ = std::move(running).value();
    stub_ = Policy::NewStub(MakeChannel(running_.address));
    SetDeadline(absl::Seconds(20), &context_);
  }
  ~PolicyServiceTest() override {
    context_.TryCancel();
    service_.Close();
  }

  TempDir folder_;
  std::vector<EvaluationReport> reports_;
  PolicyService service_;
  RunningServer running_;
  std::unique_ptr<Policy::Stub> stub_;
  grpc::ClientContext context_;
};

TEST_F(PolicyServiceTest, SubscribersGetTheNewestAndThenEachNewerOne) {
  service_.Publish(Snapshot(1));
  service_.Publish(Snapshot(2));
  const auto reader = stub_->Subscribe(&context_, Opening());
  PolicyMessage message;
  ASSERT_TRUE(reader->Read(&message));
  const auto snapshot = Decode(message);
  ASSERT_TRUE(snapshot.ok()) << snapshot.status();
  EXPECT_EQ(snapshot->version, 2u);
  EXPECT_EQ(snapshot->networks, Snapshot(2).networks);
  service_.Publish(Snapshot(3));
  ASSERT_TRUE(reader->Read(&message));
  EXPECT_EQ(message.version(), 3u);
}

TEST_F(PolicyServiceTest, StatusNamesTheSlowestSubscriber) {
  service_.Publish(Snapshot(4));
  LearnerStatus status;
  status.set_policy_version(4);
  service_.SetStatus(status);
  const auto reader = stub_->Subscribe(&context_, Opening());
  PolicyMessage message;
  ASSERT_TRUE(reader->Read(&message));
  // The service records the version after the write, so the next message comes after that.
  service_.Publish(Snapshot(5));
  ASSERT_TRUE(reader->Read(&message));
  grpc::ClientContext context;
  LearnerStatus reply;
  ASSERT_TRUE(stub_->Status(&context, LearnerStatusRequest(), &reply).ok());
  EXPECT_EQ(reply.subscribers(), 1u);
  EXPECT_EQ(reply.oldest_subscriber_version(), 4u);
}

TEST_F(PolicyServiceTest, ASubscriberOfAnotherProtocolIsRefusedAndToldWhichProgramIsOlder) {
  service_.Publish(Snapshot(1));
  for (const std::uint32_t version : {std::uint32_t{0}, kProtocolVersion + 1}) {
    grpc::ClientContext context;
    const auto reader = stub_->Subscribe(&context, Opening(version));
    PolicyMessage message;
    EXPECT_FALSE(reader->Read(&message));
    const grpc::Status status = reader->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    EXPECT_THAT(status.error_message(),
                testing::HasSubstr(version == 0 ? "the subscriber actor-0 is older than the learner"
                                                : "the learner is older than the subscriber actor-0"));
  }
}

TEST_F(PolicyServiceTest, ASubscriberThatSaysMoreThanTheServiceKnowsIsServed) {
  service_.Publish(Snapshot(1));
  SubscribeRequest newer = Opening();
  newer.GetReflection()->MutableUnknownFields(&newer)->AddVarint(1000, 7);
  const auto reader = stub_->Subscribe(&context_, newer);
  PolicyMessage message;
  ASSERT_TRUE(reader->Read(&message));
  EXPECT_EQ(message.protocol_version(), kProtocolVersion);
}

TEST_F(PolicyServiceTest, StatusSaysTheProtocolAndAClientRefusesAnother) {
  LearnerClient client(running_.address);
  const auto status = client.Status(absl::Seconds(20));
  ASSERT_TRUE(status.ok()) << status.status();
  EXPECT_EQ(status->protocol_version(), kProtocolVersion);

  class OldLearner : public Policy::Service {
    grpc::Status Status(grpc::ServerContext*, const LearnerStatusRequest*, LearnerStatus*) override {
      return grpc::Status::OK;
    }
  } old;
  const auto server = StartServer({"unix:" + folder_.path() + "/old.sock"}, {&old});
  ASSERT_TRUE(server.ok()) << server.status();
  const absl::Status refused = LearnerClient(server->address).Status(absl::Seconds(20)).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_THAT(std::string(refused.message()), testing::HasSubstr("the learner is older than this program"));
}

TEST_F(PolicyServiceTest, CloseWakesAndEndsSubscriptions) {
  service_.Publish(Snapshot(1));
  const auto reader = stub_->Subscribe(&context_, Opening());
  PolicyMessage message;
  ASSERT_TRUE(reader->Read(&message));
  service_.Close();
  EXPECT_FALSE(reader->Read(&message));
  // Without the wake-up the call's deadline ends it.
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(PolicyServiceTest, KeepsTheNewestEvaluationOfEachOpponent) {
  for (const double score : {0.5, 0.75}) {
    EvaluationReport report;
    report.set_opponent("random");
    report.set_episodes(10);
    report.set_score_mean(score);
    grpc::ClientContext context;
    EvaluationReportReply reply;
    ASSERT_TRUE(stub_->ReportEvaluation(&context, report, &reply).ok());
  }
  grpc::ClientContext context;
  LearnerStatus status;
  ASSERT_TRUE(stub_->Status(&context, LearnerStatusRequest(), &status).ok());
  ASSERT_EQ(status.evaluations_size(), 1);
  EXPECT_EQ(status.evaluations(0).score_mean(), 0.75);
  EXPECT_EQ(reports_.size(), 2u);
}

EvaluationReport Report(const std::string& opponent, std::uint64_t version) {
  EvaluationReport report;
  report.set_opponent(opponent);
  report.set_policy_version(version);
  report.set_episodes(10);
  return report;
}

// The policy versions of the reports in an answer.
std::vector<std::uint64_t> VersionsIn(const LearnerStatus& status) {
  std::vector<std::uint64_t> versions;
  for (const EvaluationReport& report : status.reports()) versions.push_back(report.policy_version());
  return versions;
}

TEST_F(PolicyServiceTest, DeliversEveryReportInOrderAfterTheOneThatTheCallerHas) {
  const auto hand_in = [this](const EvaluationReport& report) {
    EvaluationReportReply reply;
    ASSERT_TRUE(service_.ReportEvaluation(nullptr, &report, &reply).ok());
  };
  const auto ask = [this](std::uint64_t life, std::uint64_t newest) {
    LearnerClient client(running_.address);
    LearnerStatusRequest have;
    have.set_life(life);
    have.set_newest_report(newest);
    const auto status = client.Status(absl::Seconds(20), have);
    EXPECT_TRUE(status.ok()) << status.status();
    return *status;
  };
  EXPECT_THAT(VersionsIn(ask(0, 0)), testing::IsEmpty());
  // Both opponents of two policies between two questions: the newest of each opponent would be half of them.
  EvaluationReport skipping = Report("random", 2);
  skipping.add_skipped_iterations(5);
  for (const EvaluationReport& report :
       {Report("random", 1), Report("mcts:10", 1), skipping, Report("mcts:10", 2)}) {
    hand_in(report);
  }
  const LearnerStatus first = ask(0, 0);
  EXPECT_THAT(VersionsIn(first), testing::ElementsAre(1, 1, 2, 2));
  EXPECT_EQ(first.newest_report(), 4u);
  EXPECT_NE(first.life(), 0u);
  EXPECT_THAT(first.reports(2).skipped_iterations(), testing::ElementsAre(5));
  EXPECT_THAT(VersionsIn(ask(first.life(), 4)), testing::IsEmpty());
  hand_in(Report("random", 3));
  EXPECT_THAT(VersionsIn(ask(first.life(), 4)), testing::ElementsAre(3));
  EXPECT_THAT(VersionsIn(ask(first.life(), 4)), testing::ElementsAre(3)) << "an answer may have been lost";
  EXPECT_THAT(VersionsIn(ask(first.life(), 1000)), testing::IsEmpty());
  EXPECT_THAT(VersionsIn(ask(first.life() + 2, 4)), testing::ElementsAre(1, 1, 2, 2, 3))
      << "the numbers of another life mean nothing here";
  EXPECT_NE(PolicyService([](const EvaluationReport&) {}).life(), first.life());
}

TEST_F(PolicyServiceTest, HoldsSoManyReportsAndSaysHowManyThereWere) {
  constexpr std::size_t kMore = 10;
  EvaluationReportReply reply;
  for (std::size_t i = 1; i <= PolicyService::kMaxReports + kMore; ++i) {
    const EvaluationReport report = Report("random", i);
    ASSERT_TRUE(service_.ReportEvaluation(nullptr, &report, &reply).ok());
  }
  LearnerStatusRequest request;
  LearnerStatus status;
  ASSERT_TRUE(service_.Status(nullptr, &request, &status).ok());
  EXPECT_EQ(status.newest_report(), PolicyService::kMaxReports + kMore);
  ASSERT_EQ(status.reports_size(), static_cast<int>(PolicyService::kMaxReports));
  EXPECT_EQ(status.reports(0).policy_version(), kMore + 1);
}

TEST_F(PolicyServiceTest, RefusesAnEvaluationWithoutEpisodes) {
  grpc::ClientContext context;
  EvaluationReportReply reply;
  const grpc::Status status = stub_->ReportEvaluation(&context, EvaluationReport(), &reply);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_TRUE(reports_.empty());
}

}  // namespace
}  // namespace dbr
