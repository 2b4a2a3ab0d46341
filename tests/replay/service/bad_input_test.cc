// Messages that make no sense: each gets a clear error, and the server goes on.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/rng.h"
#include "proto/replay.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/codec.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/protocol.h"
#include "replay/client/client.h"
#include "replay/service/replay_server.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

constexpr absl::Duration kPatience = absl::Seconds(60);

class BadInput : public ::testing::Test {
 protected:
  BadInput() {
    ReplayServerOptions options;
    options.store.env = "connect4";
    options.store.layout = kSmallLayout;
    options.store.capacity = 1000;
    options.server.address = absl::StrCat("unix:", folder_.path(), "/replay.sock");
    server_ = std::move(*ReplayServer::Start(options));
    stub_ = Replay::NewStub(MakeChannel(server_->address()));
    opening_.set_writer_name("actor-0");
    opening_.set_writer_id(5);
    opening_.set_protocol_version(kProtocolVersion);
    SetLayout(kSmallLayout, good_.mutable_transitions());
    good_.set_first_sequence(1);
    const Rows rows(kSmallLayout, 1, 5);
    for (int i = 0; i < 5; ++i) {
      AppendTransition(rows.columns().Row(kSmallLayout, i), 1.0f, 1, good_.mutable_transitions());
    }
    good_.add_episode_ends()->set_row(4);
    good_.set_acknowledge(true);
  }

  // Sends both on a stream of their own. Gives the stream's status and the last acknowledgement.
  grpc::Status Send(const InsertRequest& opening, const InsertRequest& request,
                    InsertReply* reply = nullptr) {
    grpc::ClientContext context;
    SetDeadline(kPatience, &context);
    const auto stream = stub_->Insert(&context);
    stream->Write(opening);
    stream->Write(request);
    stream->WritesDone();
    InsertReply last;
    while (stream->Read(&last)) {
      if (reply != nullptr) *reply = last;
    }
    return stream->Finish();
  }

  StatsReply Stats() {
    const auto stats = ReplayClient(server_->address()).Stats(kPatience);
    EXPECT_TRUE(stats.ok()) << stats.status();
    return stats.ok() ? *stats : StatsReply();
  }

  TestFolder folder_;
  std::unique_ptr<ReplayServer> server_;
  std::unique_ptr<Replay::Stub> stub_;
  InsertRequest opening_, good_;
};

TEST_F(BadInput, OpeningsThatMakeNoSenseAreRefusedByName) {
  const struct {
    const char* field;
    std::function<void(InsertRequest*)> spoil;
  } cases[] = {
      {"writer_name", [](InsertRequest* m) { m->set_writer_name(""); }},
      {"writer_name", [](InsertRequest* m) { m->set_writer_name(std::string(1000, 'x')); }},
      {"writer_id", [](InsertRequest* m) { m->set_writer_id(0); }},
      {"first message", [this](InsertRequest* m) { *m->mutable_transitions() = good_.transitions(); }},
  };
  for (const auto& bad : cases) {
    InsertRequest opening = opening_;
    bad.spoil(&opening);
    const grpc::Status status = Send(opening, good_);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << bad.field;
    EXPECT_THAT(status.error_message(), HasSubstr(bad.field));
  }
  EXPECT_EQ(Stats().inserted(), 0u);
}

TEST_F(BadInput, BatchesThatMakeNoSenseAreRefusedByName) {
  const struct {
    const char* field;
    std::function<void(InsertRequest*)> spoil;
  } cases[] = {
      {"observation_width: expected 4, found 5",
       [](InsertRequest* m) { m->mutable_transitions()->set_observation_width(5); }},
      {"action_width", [](InsertRequest* m) { m->mutable_transitions()->set_action_width(~0u); }},
      {"mask_width", [](InsertRequest* m) { m->mutable_transitions()->set_mask_width(0); }},
      {"observations", [](InsertRequest* m) { m->mutable_transitions()->set_count(6); }},
      {"count", [](InsertRequest* m) { m->mutable_transitions()->set_count(~0u); }},
      {"observations", [](InsertRequest* m) { m->mutable_transitions()->set_count(0x40000000u >> 8); }},
      {"rewards", [](InsertRequest* m) { m->mutable_transitions()->clear_rewards(); }},
      {"next_masks", [](InsertRequest* m) { m->mutable_transitions()->add_next_masks(1); }},
      {"advantages", [](InsertRequest* m) { m->mutable_transitions()->add_advantages(1); }},
      {"critic_versions", [](InsertRequest* m) { m->mutable_transitions()->add_critic_versions(1); }},
      {"first_sequence", [](InsertRequest* m) { m->set_first_sequence(0); }},
      {"first_sequence", [](InsertRequest* m) { m->set_first_sequence(~std::uint64_t{0}); }},
      {"episode_ends", [](InsertRequest* m) { m->add_episode_ends()->set_row(5); }},
      {"episode_ends", [](InsertRequest* m) { m->add_episode_ends()->set_row(~0u); }},
      {"episode_ends", [](InsertRequest* m) { m->add_episode_ends()->set_row(1); }},
  };
  for (const auto& bad : cases) {
    InsertRequest request = good_;
    bad.spoil(&request);
    const grpc::Status status = Send(opening_, request);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << bad.field;
    EXPECT_THAT(status.error_message(), HasSubstr(bad.field));
  }
  EXPECT_EQ(Stats().inserted(), 0u);
}

TEST_F(BadInput, AnEmptyMessageIsNothing) {
  InsertReply reply;
  InsertRequest request;
  request.set_acknowledge(true);
  EXPECT_TRUE(Send(opening_, request, &reply).ok());
  EXPECT_EQ(reply.acknowledged_sequence(), 0u);
}

TEST_F(BadInput, AResendOnASecondStreamIsNotStoredTwice) {
  InsertReply reply;
  ASSERT_TRUE(Send(opening_, good_, &reply).ok());
  EXPECT_EQ(reply.acknowledged_sequence(), 5u);
  good_.set_first_sequence(3);
  ASSERT_TRUE(Send(opening_, good_, &reply).ok());
  EXPECT_EQ(reply.acknowledged_sequence(), 7u);
  const StatsReply stats = Stats();
  EXPECT_EQ(stats.inserted(), 7u);
  EXPECT_EQ(stats.duplicates(), 3u);
  EXPECT_FALSE(stats.writers(0).connected());
}

TEST_F(BadInput, DrawsAndRelabelsThatMakeNoSenseAreRefused) {
  ASSERT_TRUE(Send(opening_, good_).ok());
  for (const std::uint32_t count : {0u, 1u << 20, ~0u}) {
    grpc::ClientContext context;
    SampleRequest request;
    request.set_uniform(count);
    request.set_plus(count);
    request.set_minus(count);
    SampleReply reply;
    EXPECT_EQ(stub_->Sample(&context, request, &reply).error_code(), grpc::StatusCode::INVALID_ARGUMENT)
        << count;
  }
  grpc::ClientContext context;
  RelabelRequest request;
  request.add_keys(1);
  RelabelReply reply;
  EXPECT_EQ(stub_->Relabel(&context, request, &reply).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(BadInput, AWaitOfAnyLengthEnds) {
  for (const double wait_s : {-1.0, 0.0, 1e-9, std::nan("")}) {
    grpc::ClientContext context;
    SetDeadline(kPatience, &context);
    SampleRequest request;
    request.set_uniform(1);
    request.set_wait_s(wait_s);
    SampleReply reply;
    EXPECT_EQ(stub_->Sample(&context, request, &reply).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED)
        << wait_s;
  }
}

// Flips, cuts and repeats bytes of good messages and sends what comes out, whether it can be parsed or not.
TEST_F(BadInput, DamagedMessagesNeverBringTheServerDown) {
  Rng rng(11);
  grpc::GenericStub generic(MakeChannel(server_->address()));
  const std::string opening = opening_.SerializeAsString();
  for (int round = 0; round < 400; ++round) {
    std::string message = good_.SerializeAsString();
    const std::uint32_t size = static_cast<std::uint32_t>(message.size());
    for (std::uint32_t flips = 1 + rng.Below(4); flips > 0; --flips)
      message[rng.Below(size)] = static_cast<char>(rng());
    if (rng.Below(4) == 0) message.resize(rng.Below(size));
    if (rng.Below(8) == 0) message += message;
    InsertRequest parsed;
    if (parsed.ParseFromString(message)) {
      Send(opening_, parsed);
    } else {
      grpc::ClientContext context;
      SetDeadline(kPatience, &context);
      grpc::CompletionQueue queue;
      const grpc::Slice slice(message);
      grpc::ByteBuffer request(&slice, 1), reply;
      const auto call = generic.PrepareUnaryCall(&context, "/dbr.Replay/Relabel", request, &queue);
      grpc::Status status;
      call->StartCall();
      call->Finish(&reply, &status, nullptr);
      void* tag;
      bool ok;
      ASSERT_TRUE(queue.Next(&tag, &ok));
    }
  }
  const StatsReply stats = Stats();
  EXPECT_EQ(stats.total() + stats.evicted(), stats.inserted());
  if (stats.total() == 0) return;
  ReplayClient client(server_->address());
  DrawnBatches drawn;
  ASSERT_TRUE(client.Sample({.uniform = 1000}, kSmallLayout, kPatience, &drawn).ok());
  EXPECT_TRUE(drawn.uniform.observations.allFinite());
  EXPECT_TRUE(drawn.uniform.next_observations.allFinite());
  EXPECT_TRUE(drawn.uniform.rewards.allFinite());
}

}  // namespace
}  // namespace dbr
