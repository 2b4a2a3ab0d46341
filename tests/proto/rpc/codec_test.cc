#include "proto/rpc/codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/rpc/grpc_status.h"

namespace dbr {
namespace {

using testing::HasSubstr;

constexpr TransitionLayout kLayout{.observation_width = 3, .action_width = 1, .mask_width = 2};
constexpr TransitionLayout kWithReturns{
    .observation_width = 3, .action_width = 1, .mask_width = 2, .return_width = 1};

// Makes a batch of two transitions that differ in every field.
TransitionBatch TwoTransitions(const TransitionLayout& layout = kLayout) {
  TransitionBatch batch;
  SetLayout(layout, &batch);
  const float observations[2][3] = {{1, 2, 3}, {4, 5, 6}}, actions[2][1] = {{0}, {1}},
              masks[2][2] = {{1, 1}, {0, 1}};
  const float next_observations[2][3] = {{7, 8, 9}, {10, 11, 12}}, next_masks[2][2] = {{1, 0}, {0, 0}};
  for (int i = 0; i < 2; ++i) {
    AppendTransition({.observation = observations[i],
                      .action = actions[i],
                      .mask = masks[i],
                      .reward = 0.5f + i,
                      .discount = i == 0 ? 0.99f : 0.0f,
                      .next_observation = next_observations[i],
                      .next_mask = next_masks[i],
                      .monte_carlo_return = 3.5f - 5 * i},
                     i == 0 ? kUnjudged : -0.25f, 7 + i, &batch);
  }
  return batch;
}

void ExpectShapeError(const TransitionBatch& batch, const std::string& expected) {
  Batch decoded;
  for (const absl::Status& status : {CheckShape(batch, kLayout), Decode(batch, kLayout, &decoded)}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), HasSubstr(expected));
  }
}

TEST(TransitionCodecTest, ColumnsHoldWhatWasAppended) {
  const TransitionBatch batch = TwoTransitions();
  ASSERT_TRUE(CheckShape(batch, kLayout).ok());
  ASSERT_EQ(batch.count(), 2u);
  EXPECT_THAT(batch.observations(), testing::ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(batch.actions(), testing::ElementsAre(0, 1));
  EXPECT_THAT(batch.masks(), testing::ElementsAre(1, 1, 0, 1));
  EXPECT_THAT(batch.rewards(), testing::ElementsAre(0.5f, 1.5f));
  EXPECT_THAT(batch.discounts(), testing::ElementsAre(0.99f, 0));
  EXPECT_THAT(batch.next_observations(), testing::ElementsAre(7, 8, 9, 10, 11, 12));
  EXPECT_THAT(batch.next_masks(), testing::ElementsAre(1, 0, 0, 0));
  EXPECT_THAT(batch.advantages(), testing::ElementsAre(testing::IsNan(), -0.25f));
  EXPECT_THAT(batch.critic_versions(), testing::ElementsAre(7, 8));
}

TEST(TransitionCodecTest, DecodesIntoOneColumnForEachTransition) {
  Batch decoded;
  ASSERT_TRUE(Decode(TwoTransitions(), kLayout, &decoded).ok());
  ASSERT_EQ(decoded.size(), 2);
  EXPECT_EQ(decoded.observations(2, 0), 3);
  EXPECT_EQ(decoded.observations(0, 1), 4);
  EXPECT_EQ(decoded.actions(0, 1), 1);
  EXPECT_EQ(decoded.masks(0, 1), 0);
  EXPECT_EQ(decoded.rewards[1], 1.5f);
  EXPECT_EQ(decoded.discounts[0], 0.99f);
  EXPECT_EQ(decoded.next_observations(1, 0), 8);
  EXPECT_EQ(decoded.next_masks(0, 0), 1);
}

TEST(TransitionCodecTest, ReturnsTravelWhereTheLayoutHasThem) {
  TransitionBatch received;
  ASSERT_TRUE(received.ParseFromString(TwoTransitions(kWithReturns).SerializeAsString()));
  EXPECT_THAT(received.returns(), testing::ElementsAre(3.5f, -1.5f));
  Batch decoded;
  ASSERT_TRUE(Decode(received, kWithReturns, &decoded).ok());
  EXPECT_THAT(decoded.returns, testing::ElementsAre(3.5f, -1.5f));
  EXPECT_EQ(decoded.next_observations(1, 0), 8);
}

TEST(TransitionCodecTest, WithoutThemTheyCostNothing) {
  const TransitionBatch batch = TwoTransitions();
  EXPECT_EQ(batch.returns_size(), 0);
  Batch decoded;
  ASSERT_TRUE(Decode(batch, kLayout, &decoded).ok());
  EXPECT_EQ(decoded.returns.size(), 0);
}

TEST(TransitionCodecTest, ReturnsThatTheOtherSideDoesNotExpectAreRefusedByName) {
  EXPECT_THAT(std::string(CheckShape(TwoTransitions(kWithReturns), kLayout).message()),
              HasSubstr("return_width: expected 0, found 1"));
  EXPECT_THAT(std::string(CheckShape(TwoTransitions(), kWithReturns).message()),
              HasSubstr("return_width: expected 1, found 0"));
  TransitionBatch batch = TwoTransitions(kWithReturns);
  batch.mutable_returns()->Truncate(1);
  EXPECT_THAT(std::string(CheckShape(batch, kWithReturns).message()),
              HasSubstr("column 'returns': expected 2 rows of 1 values, found 1"));
}

TEST(TransitionCodecTest, SurvivesTheWire) {
  const TransitionBatch batch = TwoTransitions();
  TransitionBatch received;
  ASSERT_TRUE(received.ParseFromString(batch.SerializeAsString()));
  EXPECT_EQ(received.SerializeAsString(), batch.SerializeAsString());
  EXPECT_TRUE(CheckShape(received, kLayout).ok());
}

TEST(TransitionCodecTest, NamesTheColumnOfTheWrongLength) {
  const std::pair<const char*, google::protobuf::RepeatedField<float>* (TransitionBatch::*)()> columns[] = {
      {"observations", &TransitionBatch::mutable_observations},
      {"actions", &TransitionBatch::mutable_actions},
      {"masks", &TransitionBatch::mutable_masks},
      {"rewards", &TransitionBatch::mutable_rewards},
      {"discounts", &TransitionBatch::mutable_discounts},
      {"next_observations", &TransitionBatch::mutable_next_observations},
      {"next_masks", &TransitionBatch::mutable_next_masks},
      {"advantages", &TransitionBatch::mutable_advantages}};
  for (const auto& [name, mutable_column] : columns) {
    TransitionBatch batch = TwoTransitions();
    (batch.*mutable_column)()->Add(1);
    ExpectShapeError(batch, std::string("column '") + name + "'");
    (batch.*mutable_column)()->Truncate(1);
    ExpectShapeError(batch, std::string("column '") + name + "'");
  }
  TransitionBatch batch = TwoTransitions();
  batch.add_critic_versions(1);
  ExpectShapeError(batch, "column 'critic_versions': expected 2 values, found 3");
}

TEST(TransitionCodecTest, NamesTheWidthThatDiffers) {
  TransitionBatch batch = TwoTransitions();
  batch.set_observation_width(4);
  ExpectShapeError(batch, "observation_width: expected 3, found 4");
  batch = TwoTransitions();
  batch.set_action_width(2);
  ExpectShapeError(batch, "action_width: expected 1, found 2");
  batch = TwoTransitions();
  batch.set_mask_width(0);
  ExpectShapeError(batch, "mask_width: expected 2, found 0");
}

TEST(TransitionCodecTest, RefusesCountsThatNoMessageHolds) {
  TransitionBatch batch = TwoTransitions();
  for (const std::uint32_t count : {3u, 1u << 30, ~0u}) {
    batch.set_count(count);
    EXPECT_EQ(CheckShape(batch, kLayout).code(), absl::StatusCode::kInvalidArgument) << count;
  }
}

TEST(TransitionCodecTest, AdvantagesMayBeLeftOut) {
  TransitionBatch batch = TwoTransitions();
  batch.clear_advantages();
  batch.clear_critic_versions();
  EXPECT_TRUE(CheckShape(batch, kLayout).ok());
}

PolicySnapshot Snapshot() {
  PolicySnapshot snapshot;
  snapshot.version = 3;
  snapshot.updates = 500;
  snapshot.spec = {.env = "connect4",
                   .algorithm = "dbr",
                   .observation_size = 84,
                   .actions = {ActionKind::kDiscrete, 7},
                   .hidden_sizes = {256, 128}};
  snapshot.support_epsilon = 0.2f;
  snapshot.networks = {{kPolicyNetwork, {1, 2}}, {kCritic1, {3}}};
  return snapshot;
}

TEST(PolicyCodecTest, DecodesWhatWasEncoded) {
  PolicySnapshot snapshot = Snapshot();
  for (const bool layer_norm : {false, true}) {
    snapshot.spec.critic_layer_norm = layer_norm;
    PolicyMessage received;
    ASSERT_TRUE(received.ParseFromString(Encode(snapshot).SerializeAsString()));
    const auto decoded = Decode(received);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->version, snapshot.version);
    EXPECT_EQ(decoded->updates, snapshot.updates);
    EXPECT_EQ(decoded->spec, snapshot.spec);
    EXPECT_EQ(decoded->support_epsilon, snapshot.support_epsilon);
    EXPECT_EQ(decoded->networks, snapshot.networks);
  }
}

TEST(PolicyCodecTest, DamagedParametersAreFound) {
  PolicyMessage message = Encode(Snapshot());
  message.mutable_networks(1)->set_parameters(0, 3.5f);
  const absl::Status status = Decode(message).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), HasSubstr("policy version 3 is damaged"));
}

TEST(PolicyCodecTest, SizesThatMakeNoSenseAreNamed) {
  for (const std::uint32_t size : {0u, 1u << 31, ~0u}) {
    PolicyMessage message = Encode(Snapshot());
    message.set_observation_size(size);
    EXPECT_THAT(std::string(Decode(message).status().message()), HasSubstr("observation_size"));
    message = Encode(Snapshot());
    message.set_action_size(size);
    EXPECT_THAT(std::string(Decode(message).status().message()), HasSubstr("action_size"));
    message = Encode(Snapshot());
    message.set_hidden_sizes(1, size);
    EXPECT_EQ(Decode(message).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(GrpcStatusTest, EveryCodeAndMessageComesBack) {
  for (int code = 0; code <= 16; ++code) {
    const absl::Status status(static_cast<absl::StatusCode>(code), "why");
    EXPECT_EQ(FromGrpc(ToGrpc(status)), status) << status;
  }
  EXPECT_EQ(ToGrpc(absl::UnavailableError("x")).error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(GrpcStatusTest, AServerWithoutTheServiceIsSaidToBeAnother) {
  const absl::Status status = FromGrpc(grpc::Status(grpc::StatusCode::UNIMPLEMENTED, ""));
  EXPECT_TRUE(absl::IsUnimplemented(status));
  EXPECT_NE(status.message().find("another program"), std::string::npos) << status;
}

}  // namespace
}  // namespace dbr
