#include "proto/rpc/server.h"

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <memory>

#include "core/file_io.h"
#include "proto/health.grpc.pb.h"
#include "proto/replay.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/deadline.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;

constexpr absl::Duration kTimeout = absl::Seconds(20);

grpc::ByteBuffer ToBuffer(const std::string& bytes) {
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

std::string ToString(const grpc::ByteBuffer& buffer) {
  grpc::Slice slice;
  return buffer.DumpToSingleSlice(&slice).ok()
             ? std::string(reinterpret_cast<const char*>(slice.begin()), slice.size())
             : "";
}

// Sends one message to a method by its name and gives the first answer's bytes; "" where the call failed.
std::string CallByName(const std::string& address, const std::string& method, const std::string& request) {
  grpc::GenericStub stub(MakeChannel(address));
  grpc::ClientContext context;
  SetDeadline(kTimeout, &context);
  context.set_wait_for_ready(true);
  grpc::CompletionQueue queue;
  const auto call = stub.PrepareCall(&context, method, &queue);
  void* tag = nullptr;
  bool ok = false;
  grpc::ByteBuffer response;
  call->StartCall(nullptr);
  bool good = queue.Next(&tag, &ok) && ok;
  if (good) call->Write(ToBuffer(request), nullptr);
  good = good && queue.Next(&tag, &ok) && ok;
  if (good) call->Read(&response, nullptr);
  good = good && queue.Next(&tag, &ok) && ok;
  context.TryCancel();
  grpc::Status status;
  call->Finish(&status, nullptr);
  queue.Next(&tag, &ok);
  queue.Shutdown();
  while (queue.Next(&tag, &ok)) {
  }
  return good ? ToString(response) : "";
}

bool IsServing(const std::string& address) {
  using grpc::health::v1::HealthCheckResponse;
  grpc::ClientContext context;
  SetDeadline(kTimeout, &context);
  context.set_wait_for_ready(true);
  HealthCheckResponse response;
  const grpc::Status status =
      grpc::health::v1::Health::NewStub(MakeChannel(address))->Check(&context, {}, &response);
  return status.ok() && response.status() == HealthCheckResponse::SERVING;
}

class ServerTest : public testing::Test {
 protected:
  absl::StatusOr<RunningServer> Start(const std::string& address, bool allow_insecure = false) {
    return StartServer({.address = address, .allow_insecure = allow_insecure}, {&service_});
  }
  std::string socket_address() const { return "unix:" + folder_ / "a.sock"; }

  const TempDir folder_;
  Replay::Service service_;
};

TEST_F(ServerTest, AnswersTheHealthCheckOnAUnixSocket) {
  const auto running = Start(socket_address());
  ASSERT_TRUE(running.ok()) << running.status();
  EXPECT_EQ(running->address, socket_address());
  EXPECT_TRUE(IsServing(running->address));
}

TEST_F(ServerTest, PicksAPortAndSaysWhich) {
  const auto running = Start("127.0.0.1:0");
  ASSERT_TRUE(running.ok()) << running.status();
  EXPECT_NE(running->address, "127.0.0.1:0");
  EXPECT_TRUE(IsServing(running->address));
}

TEST_F(ServerTest, ReflectionNamesTheServices) {
  const auto running = Start(socket_address());
  ASSERT_TRUE(running.ok()) << running.status();
  // A ServerReflectionRequest with list_services (field 7) "*", written by hand: no package has its class.
  const std::string services = CallByName(
      running->address, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", "\x3a\x01*");
  EXPECT_THAT(services, HasSubstr("dbr.Replay"));
  EXPECT_THAT(services, HasSubstr("grpc.health.v1.Health"));
}

TEST_F(ServerTest, AnAddressInUseIsSaid) {
  for (const std::string& address : {socket_address(), std::string("127.0.0.1:0")}) {
    const auto first = Start(address);
    ASSERT_TRUE(first.ok()) << first.status();
    const absl::Status second = Start(first->address).status();
    EXPECT_EQ(second.code(), absl::StatusCode::kAlreadyExists) << second;
    EXPECT_THAT(std::string(second.message()), HasSubstr(first->address + ": the address is in use"));
    EXPECT_TRUE(IsServing(first->address)) << "the first server must not be harmed";
  }
}

TEST_F(ServerTest, AStaleSocketIsReplaced) {
  const std::string path = folder_ / "a.sock";
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  close(fd);  // a killed server leaves such a socket
  const auto running = Start(socket_address());
  ASSERT_TRUE(running.ok()) << running.status();
  EXPECT_TRUE(IsServing(running->address));
}

TEST_F(ServerTest, AFileThatIsNoSocketIsLeftAlone) {
  const std::string path = folder_ / "a.sock";
  std::ofstream(path) << "precious";
  const absl::Status status = Start(socket_address()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  EXPECT_EQ(ReadFile(path).value(), "precious");
}

TEST_F(ServerTest, AnAddressOfOtherMachinesNeedsTheUsersWord) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.0.2.1:8000", "example.org:80", "ipv4:0.0.0.0:0"}) {
    const absl::Status status = Start(address).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << address;
    EXPECT_THAT(std::string(status.message()), HasSubstr("--allow-insecure"));
    EXPECT_THAT(std::string(status.message()), HasSubstr(address));
  }
  const auto running = Start("0.0.0.0:0", /*allow_insecure=*/true);
  EXPECT_TRUE(running.ok()) << running.status();
}

TEST_F(ServerTest, AHostThatOnlyBeginsLikeLoopbackIsNotLoopback) {
  EXPECT_EQ(Start("127.example.org:80").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ServerTest, AnOverlongSocketPathSaysTheLimit) {
  const absl::Status status = Start("unix:" + folder_ / std::string(200, 'x')).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("expected 1 to 107 characters"));
  EXPECT_EQ(Start("unix:").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ServerTest, AnAddressWithoutAPortSaysTheForm) {
  const absl::Status status = Start("localhost").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("HOST:PORT"));
}

}  // namespace
}  // namespace dbr
