// Programs of different protocol versions over a real socket, in both directions.
#include "proto/rpc/protocol.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/stop_flag.h"
#include "proto/replay.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/server.h"
#include "replay/client/await_stats.h"
#include "replay/client/client.h"
#include "replay/client/writer.h"
#include "replay/service/replay_server.h"
#include "tests/replay/rows.h"

namespace dbr {
namespace {

using ::testing::HasSubstr;

constexpr absl::Duration kPatience = absl::Seconds(60);  // only a failure waits that long
constexpr std::uint32_t kBefore = 0;
constexpr std::uint32_t kNext = kProtocolVersion + 1;

template <class Message>
Message WithAnUnknownField(Message message) {
  message.GetReflection()->MutableUnknownFields(&message)->AddVarint(1000, 7);
  return message;
}

InsertRequest Opening(std::uint32_t protocol_version) {
  InsertRequest opening;
  opening.set_writer_name("actor-0");
  opening.set_writer_id(5);
  opening.set_protocol_version(protocol_version);
  return opening;
}

// A replay server of another release: it takes no notice of what it does not know.
class OtherReplay : public Replay::Service {
 public:
  explicit OtherReplay(std::uint32_t protocol_version) : protocol_version_(protocol_version) {}

  grpc::Status Insert(grpc::ServerContext*,
                      grpc::ServerReaderWriter<InsertReply, InsertRequest>* stream) override {
    ++streams_;
    InsertRequest request;
    std::uint64_t last = 0;
    while (stream->Read(&request)) {
      if (request.has_transitions()) last = request.first_sequence() + request.transitions().count() - 1;
      InsertReply reply;
      reply.set_acknowledged_sequence(last);
      reply.set_protocol_version(protocol_version_);
      stream->Write(WithAnUnknownField(reply));
    }
    return grpc::Status::OK;
  }
  grpc::Status Stats(grpc::ServerContext*, const StatsRequest*, StatsReply* reply) override {
    ++questions_;
    reply->set_protocol_version(protocol_version_);
    *reply = WithAnUnknownField(*reply);
    return grpc::Status::OK;
  }

  int streams() const { return streams_; }
  int questions() const { return questions_; }

 private:
  const std::uint32_t protocol_version_;
  std::atomic<int> streams_{0}, questions_{0};
};

class ProtocolOverSocket : public ::testing::Test {
 protected:
  std::string address() const { return absl::StrCat("unix:", folder_.path(), "/replay.sock"); }

  std::unique_ptr<ReplayServer> StartOurs() const {
    ReplayServerOptions options;
    options.store.env = "connect4";
    options.store.layout = kSmallLayout;
    options.store.capacity = 100;
    options.server.address = address();
    auto server = ReplayServer::Start(options);
    EXPECT_TRUE(server.ok()) << server.status();
    return std::move(*server);
  }

  // Opens a stream with `opening`; its status, and the answer where there is one.
  grpc::Status Open(const InsertRequest& opening, InsertReply* answer) const {
    const auto stub = Replay::NewStub(MakeChannel(address()));
    grpc::ClientContext context;
    SetDeadline(kPatience, &context);
    const auto stream = stub->Insert(&context);
    stream->Write(opening);
    stream->WritesDone();
    if (stream->Read(answer)) {
      InsertReply more;
      while (stream->Read(&more)) continue;
    }
    return stream->Finish();
  }

  // Writes one transition to whoever serves the address.
  absl::Status WriteOne() const {
    TransitionWriter writer({.address = address(), .name = "actor-0", .layout = kSmallLayout});
    const Rows rows(kSmallLayout, 1, 1);
    const absl::Status status =
        writer.Append(rows.columns().Row(kSmallLayout, 0), kUnjudged, 0, std::nullopt, kPatience);
    return status.ok() ? writer.Flush(kPatience) : status;
  }

  TestFolder folder_;
};

TEST_F(ProtocolOverSocket, AServerRefusesAnOlderWriterAndSaysSo) {
  const auto server = StartOurs();
  InsertReply answer;
  const grpc::Status status = Open(Opening(kBefore), &answer);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("found 0 (a program from before 0.2.0)"));
  EXPECT_THAT(status.error_message(), HasSubstr("the writer actor-0 is older than the replay server"));
}

TEST_F(ProtocolOverSocket, AServerRefusesANewerWriterAndCallsItselfOlder) {
  const auto server = StartOurs();
  InsertReply answer;
  const grpc::Status status = Open(Opening(kNext), &answer);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("the replay server is older than the writer actor-0"));
}

TEST_F(ProtocolOverSocket, AnotherVersionIsSaidBeforeAnythingElseIsWrong) {
  const auto server = StartOurs();
  InsertRequest opening = Opening(kNext);
  opening.clear_writer_id();
  InsertReply answer;
  EXPECT_EQ(Open(opening, &answer).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(ProtocolOverSocket, AWriterThatSaysMoreThanTheServerKnowsIsServed) {
  const auto server = StartOurs();
  InsertReply answer;
  const grpc::Status status = Open(WithAnUnknownField(Opening(kProtocolVersion)), &answer);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(answer.protocol_version(), kProtocolVersion);
}

TEST_F(ProtocolOverSocket, ClientsRefuseAServerOfAnotherVersionForGood) {
  for (const std::uint32_t version : {kBefore, kNext}) {
    OtherReplay other(version);
    const auto server = StartServer({.address = address()}, {&other});
    ASSERT_TRUE(server.ok()) << server.status();
    const absl::Status write = WriteOne();
    EXPECT_TRUE(absl::IsFailedPrecondition(write)) << write;
    EXPECT_THAT(std::string(write.message()),
                HasSubstr(version == kBefore ? "the replay server is older than the writer actor-0"
                                             : "the writer actor-0 is older than the replay server"));
    EXPECT_EQ(other.streams(), 1) << "another try cannot mend it";
    ReplayClient client(address());
    const absl::Status stats = client.Stats(kPatience).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(stats)) << stats;
    EXPECT_THAT(std::string(stats.message()),
                HasSubstr(version == kBefore ? "the replay server is older than this program"
                                             : "this program is older than the replay server"));
    const StopFlag never;
    EXPECT_EQ(AwaitStats(&client, "for this test", never).status(), stats);
    EXPECT_EQ(other.questions(), 2);
  }
}

TEST_F(ProtocolOverSocket, AServerThatSaysMoreThanClientsKnowServesThem) {
  OtherReplay other(kProtocolVersion);
  const auto server = StartServer({.address = address()}, {&other});
  ASSERT_TRUE(server.ok()) << server.status();
  const absl::Status write = WriteOne();
  EXPECT_TRUE(write.ok()) << write;
  const auto stats = ReplayClient(address()).Stats(kPatience);
  EXPECT_TRUE(stats.ok()) << stats.status();
}

TEST_F(ProtocolOverSocket, OurServerServesOurClients) {
  const auto server = StartOurs();
  const absl::Status write = WriteOne();
  EXPECT_TRUE(write.ok()) << write;
  const auto stats = ReplayClient(address()).Stats(kPatience);
  ASSERT_TRUE(stats.ok()) << stats.status();
  EXPECT_EQ(stats->inserted(), 1u);
  EXPECT_EQ(stats->protocol_version(), kProtocolVersion);
}

}  // namespace
}  // namespace dbr
