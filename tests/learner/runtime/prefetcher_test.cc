// Which failures of a draw end the drawing, and which are waited out.
#include "learner/runtime/prefetcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "proto/replay.grpc.pb.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/server.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

constexpr TransitionLayout kLayout{.observation_width = 2, .action_width = 1, .mask_width = 0};

// Fails the first draw with a status, and gives a transition with the second one.
class FailingReplay : public Replay::Service {
 public:
  explicit FailingReplay(grpc::StatusCode code) : code_(code) {}

  grpc::Status Sample(grpc::ServerContext*, const SampleRequest* request, SampleReply* reply) override {
    if (draws_++ == 0 && code_ != grpc::StatusCode::OK) return grpc::Status(code_, "as this test wants it");
    for (SampledPart* part : {reply->mutable_uniform(), reply->mutable_plus(), reply->mutable_minus()}) {
      SetLayout(kLayout, part->mutable_transitions());
    }
    const std::vector<float> observation = {1, 2}, action = {0.5};
    const TransitionView row{.observation = observation,
                             .action = action,
                             .mask = {},
                             .reward = static_cast<float>(request->seed_buffer_share()),
                             .discount = static_cast<float>(request->first_transitions()),
                             .next_observation = observation,
                             .next_mask = {}};
    AppendTransition(row, kUnjudged, 0, reply->mutable_uniform()->mutable_transitions());
    if (with_keys) reply->mutable_uniform()->add_keys(1);
    return grpc::Status::OK;
  }

  bool with_keys = true;

 private:
  const grpc::StatusCode code_;
  int draws_ = 0;
};

class PrefetcherTest : public testing::Test {
 protected:
  // What Next gives with `replay` behind it.
  absl::StatusOr<std::unique_ptr<DrawnBatches>> NextFrom(FailingReplay* replay) const {
    const auto server = StartServer({.address = "unix:" + folder_.path() + "/replay.sock"}, {replay});
    EXPECT_TRUE(server.ok()) << server.status();
    ReplayClient client(server->address);
    Prefetcher prefetcher(
        &client,
        {.counts = {.uniform = 1}, .layout = kLayout, .depth = 1, .retry_after = absl::Milliseconds(1)});
    return prefetcher.Next();
  }

  TempDir folder_;
};

TEST_F(PrefetcherTest, WaitsOutWhatMayPass) {
  for (const auto code : {grpc::StatusCode::UNAVAILABLE, grpc::StatusCode::INTERNAL,
                          grpc::StatusCode::RESOURCE_EXHAUSTED, grpc::StatusCode::DEADLINE_EXCEEDED}) {
    FailingReplay replay(code);
    const auto batches = NextFrom(&replay);
    ASSERT_TRUE(batches.ok()) << batches.status();
    EXPECT_EQ((*batches)->uniform.size(), 1);
  }
}

TEST_F(PrefetcherTest, EndsWithAnErrorThatNoOtherTryMends) {
  for (const auto code : {grpc::StatusCode::INVALID_ARGUMENT, grpc::StatusCode::FAILED_PRECONDITION,
                          grpc::StatusCode::PERMISSION_DENIED}) {
    FailingReplay replay(code);
    const absl::Status status = NextFrom(&replay).status();
    EXPECT_EQ(status, absl::Status(static_cast<absl::StatusCode>(code), "as this test wants it"));
  }
}

TEST_F(PrefetcherTest, ABatchWithoutItsKeysIsAFinalError) {
  FailingReplay replay(grpc::StatusCode::UNAVAILABLE);
  replay.with_keys = false;
  const absl::Status status = NextFrom(&replay).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("keys: expected 1"));
}

TEST_F(PrefetcherTest, BatchesOfEarlierTermsAreDropped) {
  FailingReplay replay(grpc::StatusCode::OK);
  const auto server = StartServer({.address = "unix:" + folder_.path() + "/replay.sock"}, {&replay});
  ASSERT_TRUE(server.ok()) << server.status();
  ReplayClient client(server->address);
  Prefetcher prefetcher(&client, {.counts = {.uniform = 1}, .layout = kLayout, .depth = 4});
  const auto before = prefetcher.Next();
  ASSERT_TRUE(before.ok()) << before.status();
  EXPECT_EQ((*before)->uniform.rewards[0], 0);
  prefetcher.SetTerms({.seed_buffer_share = 0.5, .first_transitions = 7});
  for (int i = 0; i < 8; ++i) {
    const auto after = prefetcher.Next();
    ASSERT_TRUE(after.ok()) << after.status();
    EXPECT_EQ((*after)->uniform.rewards[0], 0.5f);
    EXPECT_EQ((*after)->uniform.discounts[0], 7);
  }
}

}  // namespace
}  // namespace dbr
