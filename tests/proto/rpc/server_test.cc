#include "proto/rpc/server.h"

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>

#include "absl/cleanup/cleanup.h"
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

grpc::Status CheckHealth(const std::string& address) {
  using grpc::health::v1::HealthCheckResponse;
  grpc::ClientContext context;
  SetDeadline(kTimeout, &context);
  context.set_wait_for_ready(true);
  HealthCheckResponse response;
  const grpc::Status status =
      grpc::health::v1::Health::NewStub(MakeChannel(address))->Check(&context, {}, &response);
  if (!status.ok() || response.status() == HealthCheckResponse::SERVING) return status;
  return grpc::Status(grpc::StatusCode::INTERNAL, "it answers that it does not serve");
}

bool IsServing(const std::string& address) {
  return CheckHealth(address).ok();
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
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.0.2.1:8000", "example.org:80"}) {
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

TEST_F(ServerTest, WhatIsNoAddressIsRefusedByServersAndClients) {
  for (const char* address : {"localhost", "127.0.0.1:99999", "unix:", "::1:80"}) {
    const absl::Status status = Start(address).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << address;
    EXPECT_THAT(std::string(status.message()), HasSubstr("HOST:PORT"));
    const grpc::Status called = CheckHealth(address);
    EXPECT_EQ(called.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << address;
    EXPECT_EQ(called.error_message(), std::string(status.message()));
  }
}

TEST_F(ServerTest, NoProxyOfTheEnvironmentIsAsked) {
  const auto running = Start("127.0.0.1:0");
  ASSERT_TRUE(running.ok()) << running.status();
  const char* const names[] = {"http_proxy", "https_proxy", "grpc_proxy"};
  for (const char* name : names) setenv(name, "http://127.0.0.1:9", /*overwrite=*/1);
  const absl::Cleanup unset = [&] {
    for (const char* name : names) unsetenv(name);
  };
  EXPECT_TRUE(IsServing(running->address));
  const std::string port = running->address.substr(running->address.rfind(':'));
  EXPECT_TRUE(IsServing("localhost" + port)) << "by a name";
}

TEST_F(ServerTest, ServesAndIsReachedOverIpv6) {
  const auto running = Start("[::1]:0");
  if (!running.ok()) GTEST_SKIP() << "this machine has no IPv6: " << running.status();
  EXPECT_TRUE(IsServing(running->address)) << running->address;
}

}  // namespace
}  // namespace dbr
