#include "actor/policy_subscriber.h"

#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/actor/learner_double.h"
#include "tests/actor/line_env.h"
#include "tests/actor/test_policies.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;
using PolicyPtr = PolicySubscriber::PolicyPtr;

constexpr absl::Duration kLong = absl::Seconds(30);  // reached only where a test fails

// Captures the log during its lifetime. Read it after the threads that log have ended.
class CapturedLog {
 public:
  CapturedLog() : before_(spdlog::default_logger()) {
    auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(text_);
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
  }
  ~CapturedLog() { spdlog::set_default_logger(before_); }

  int Count(const std::string& words) const {
    const std::string text = text_.str();
    int count = 0;
    for (auto at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++count;
    return count;
  }

 private:
  std::ostringstream text_;
  std::shared_ptr<spdlog::logger> before_;
};

class PolicySubscriberTest : public ::testing::Test {
 protected:
  std::unique_ptr<PolicySubscriber> Subscribe() {
    Config config;
    config.mutable_network()->add_hidden_sizes(16);
    config.mutable_network()->add_hidden_sizes(16);
    return std::make_unique<PolicySubscriber>(SubscriberOptions{.address = address_,
                                                                .name = "actor-0",
                                                                .expected = ExpectedPolicy(spec_, config),
                                                                .seed = 1,
                                                                .first_backoff = absl::Milliseconds(1),
                                                                .max_backoff = absl::Milliseconds(20)});
  }
  PolicyMessage Version(std::uint64_t version) const { return Encode(UntrainedSnapshot(spec_, version)); }

  SocketFolder folder_;
  const std::string address_ = folder_.Address("learner");
  const EnvSpec spec_ = LineEnv().spec();
};

TEST_F(PolicySubscriberTest, HoldsTheNewestPolicy) {
  LearnerDouble learner(address_);
  learner.Offer(Version(1));
  const auto subscriber = Subscribe();
  PolicyPtr policy = subscriber->WaitForFirst(kLong).value();
  EXPECT_EQ(policy->snapshot().version, 1);
  EXPECT_EQ(policy->snapshot().networks, UntrainedSnapshot(spec_, 1).networks);
  learner.Offer(Version(2));
  policy = subscriber->WaitForOther(policy, kLong).value();
  EXPECT_EQ(policy->snapshot().version, 2);
  EXPECT_EQ(subscriber->Current().value(), policy);
}

TEST_F(PolicySubscriberTest, HasNoneBeforeTheFirst) {
  LearnerDouble learner(address_);
  const auto subscriber = Subscribe();
  EXPECT_EQ(subscriber->Current().value(), nullptr);
  const absl::Status status = subscriber->WaitForFirst(absl::Milliseconds(1)).status();
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(address_));
}

TEST_F(PolicySubscriberTest, RefusesPoliciesOfOtherNetworkSizesForGood) {
  LearnerDouble learner(address_);
  PolicySnapshot other = UntrainedSnapshot(spec_, 1);
  other.spec.hidden_sizes = {16, 32};
  learner.Offer(Encode(other));
  const auto subscriber = Subscribe();
  const absl::Status status = subscriber->WaitForFirst(kLong).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("hidden_sizes: expected 16-16, found 16-32"));
  EXPECT_EQ(subscriber->Current().status(), status);
}

TEST_F(PolicySubscriberTest, RefusesPoliciesWithOtherwiseNormalisedCriticsForGood) {
  LearnerDouble learner(address_);
  PolicySnapshot other = UntrainedSnapshot(spec_, 1);
  other.spec.critic_layer_norm = true;
  learner.Offer(Encode(other));
  const absl::Status status = Subscribe()->WaitForFirst(kLong).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("critic_layer_norm: expected false, found true"));
}

TEST_F(PolicySubscriberTest, RefusesPoliciesOfAnotherEnvironmentForGood) {
  LearnerDouble learner(address_);
  learner.Offer(Encode(UntrainedSnapshot(Connect4Spec(), 1)));
  const absl::Status status = Subscribe()->WaitForFirst(kLong).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("env: expected line, found connect4"));
}

TEST_F(PolicySubscriberTest, RefusesPoliciesWithMissingParametersForGood) {
  LearnerDouble learner(address_);
  PolicySnapshot shorter = UntrainedSnapshot(spec_, 1);
  shorter.networks[1].second.pop_back();
  learner.Offer(Encode(shorter));
  const absl::Status status = Subscribe()->WaitForFirst(kLong).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(kCritic1));
}

TEST_F(PolicySubscriberTest, RefusesALearnerOfAnotherProtocolForGood) {
  for (const std::uint32_t version : {std::uint32_t{0}, kProtocolVersion + 1}) {
    LearnerDouble learner(address_, version);
    learner.Offer(Version(1));
    const auto subscriber = Subscribe();
    const absl::Status status = subscriber->WaitForFirst(kLong).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_THAT(std::string(status.message()),
                HasSubstr(version == 0 ? "the learner is older" : "actor-0 is older"));
    EXPECT_EQ(subscriber->Current().status(), status);
    EXPECT_EQ(learner.subscriptions(), 1);
  }
}

TEST_F(PolicySubscriberTest, TakesAPolicyWithAFieldThatItDoesNotKnow) {
  LearnerDouble learner(address_);
  PolicyMessage newer = Version(1);
  newer.GetReflection()->MutableUnknownFields(&newer)->AddVarint(1000, 7);
  learner.Offer(newer);
  EXPECT_TRUE(Subscribe()->WaitForFirst(kLong).ok());
}

TEST_F(PolicySubscriberTest, SaysThatAServerIsNoLearner) {
  const RunningServer server = StartServer({.address = address_}, {}).value();
  const absl::Status status = Subscribe()->WaitForFirst(kLong).status();
  EXPECT_TRUE(absl::IsUnimplemented(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("expected a learner"));
}

TEST_F(PolicySubscriberTest, KeepsThePolicyWhileTheLearnerIsAwayAndTakesALowerVersionAfterwards) {
  CapturedLog log;
  auto learner = std::make_unique<LearnerDouble>(address_);
  learner->Offer(Version(100));
  auto subscriber = Subscribe();
  const PolicyPtr before = subscriber->WaitForFirst(kLong).value();
  learner.reset();
  EXPECT_EQ(subscriber->Current().value(), before);
  learner = std::make_unique<LearnerDouble>(address_);
  learner->RefuseNext(3);
  learner->Offer(Version(3));
  EXPECT_EQ(subscriber->WaitForOther(before, kLong).value()->snapshot().version, 3);
  subscriber.reset();
  EXPECT_GE(learner->subscriptions(), 4);
  EXPECT_EQ(log.Count("no policies from the learner"), 1);
  EXPECT_EQ(log.Count("sends policies"), 1);
  EXPECT_EQ(log.Count("offers policy version 3 after version 100"), 1);
}

TEST_F(PolicySubscriberTest, WaitsForALearnerThatStartsLater) {
  const auto subscriber = Subscribe();
  ASSERT_FALSE(subscriber->WaitForFirst(absl::Milliseconds(1)).ok());
  LearnerDouble learner(address_);
  learner.Offer(Version(1));
  EXPECT_TRUE(subscriber->WaitForFirst(kLong).ok());
}

TEST_F(PolicySubscriberTest, DropsADamagedPolicyAndAsksAgain) {
  CapturedLog log;
  LearnerDouble learner(address_);
  learner.Offer(Version(1));
  auto subscriber = Subscribe();
  const PolicyPtr whole = subscriber->WaitForFirst(kLong).value();
  PolicyMessage damaged = Version(2);
  damaged.mutable_networks(0)->set_parameters(0, damaged.networks(0).parameters(0) + 1);
  const int before = learner.subscriptions();
  learner.Offer(damaged);
  ASSERT_TRUE(learner.AwaitSubscriptions(before + 3, kLong));
  EXPECT_EQ(subscriber->Current().value(), whole);
  learner.Offer(Version(2));
  EXPECT_EQ(subscriber->WaitForOther(whole, kLong).value()->snapshot().version, 2);
  subscriber.reset();
  EXPECT_EQ(log.Count("policy version 2 is damaged"), 1);
}

TEST_F(PolicySubscriberTest, CloseWakesThoseWhoWait) {
  LearnerDouble learner(address_);
  const auto subscriber = Subscribe();
  absl::Status status;
  std::thread waiting([&] { status = subscriber->WaitForFirst(absl::InfiniteDuration()).status(); });
  subscriber->Close();
  waiting.join();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
}

}  // namespace
}  // namespace dbr
