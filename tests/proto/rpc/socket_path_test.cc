#include "proto/rpc/socket_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/file_io.h"
#include "proto/health.grpc.pb.h"
#include "proto/rpc/channel.h"
#include "proto/rpc/deadline.h"
#include "proto/rpc/server.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr absl::Duration kTimeout = absl::Seconds(20);

grpc::Status Check(grpc::health::v1::Health::Stub* stub) {
  grpc::ClientContext context;
  SetDeadline(kTimeout, &context);
  context.set_wait_for_ready(true);
  grpc::health::v1::HealthCheckResponse response;
  return stub->Check(&context, {}, &response);
}

bool IsServing(const std::string& address) {
  return Check(grpc::health::v1::Health::NewStub(MakeChannel(address)).get()).ok();
}

// Serves at a socket in `folder`, which it makes, and asks it there.
void ServeIn(const std::string& folder, const std::string& name = "replay.sock") {
  std::filesystem::create_directories(folder);
  const std::string path = absl::StrCat(folder, "/", name);
  {
    const auto running = StartServer({.address = absl::StrCat("unix:", path)}, {});
    ASSERT_TRUE(running.ok()) << running.status();
    EXPECT_EQ(running->address, absl::StrCat("unix:", path)) << "as the user wrote it";
    EXPECT_TRUE(std::filesystem::is_socket(path)) << path;
    EXPECT_TRUE(IsServing(running->address)) << path;
    EXPECT_EQ(StartServer({.address = running->address}, {}).status().code(),
              absl::StatusCode::kAlreadyExists);
  }
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(path))) << "left behind: " << path;
}

TEST(SocketPathTest, AFolderMayHaveAnyByteInItsName) {
  const TempDir folder;
  for (int byte = 1; byte < 256; ++byte) {
    if (byte == '/') continue;
    SCOPED_TRACE(absl::StrCat("byte ", byte));
    ServeIn(folder / std::string(1, static_cast<char>(byte)) + "41");
  }
}

TEST(SocketPathTest, ASocketMayHaveAnyByteButACommaInItsName) {
  const TempDir folder;
  for (int byte = 1; byte < 256; ++byte) {
    if (byte == '/' || byte == ',') continue;
    SCOPED_TRACE(absl::StrCat("byte ", byte));
    ServeIn(folder.path(), std::string(1, static_cast<char>(byte)) + "41");
  }
}

TEST(SocketPathTest, AFolderMayBeDeeperThanASocketsPathIsLong) {
  const TempDir folder;
  std::string deep = folder.path();
  while (deep.size() < 3000) deep += "/" + std::string(200, 'd');
  ServeIn(deep);
  // At the limit of the kernel and beyond it, so that both ways are taken.
  for (const std::size_t size : {106u, 107u, 108u}) {
    const std::size_t rest = size - folder.path().size() - std::string("//replay.sock").size();
    ServeIn(folder / std::string(rest, 'x'));
  }
}

TEST(SocketPathTest, AClientFindsAServerThatComesLaterAndAgain) {
  const TempDir folder;
  const std::string run = folder / "a, run";
  std::filesystem::create_directories(run);
  const std::string address = absl::StrCat("unix:", run, "/replay.sock");
  const auto stub = grpc::health::v1::Health::NewStub(MakeChannel(address));
  for (int start = 0; start < 2; ++start) {
    const auto running = StartServer({.address = address}, {});
    ASSERT_TRUE(running.ok()) << running.status();
    EXPECT_TRUE(Check(stub.get()).ok());
  }
}

TEST(SocketPathTest, ASocketThatAKilledServerLeftInSuchAFolderIsReplaced) {
  const TempDir folder;
  const std::string run = folder / std::string(200, 'x'), moved = folder / "moved";
  std::filesystem::create_directories(run);
  const std::string address = absl::StrCat("unix:", run, "/replay.sock");
  {
    const auto running = StartServer({.address = address}, {});
    ASSERT_TRUE(running.ok()) << running.status();
    std::filesystem::rename(run + "/replay.sock", moved);
  }
  std::filesystem::rename(moved, run + "/replay.sock");  // nobody listens there any more
  const auto again = StartServer({.address = address}, {});
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(IsServing(address));
}

TEST(SocketPathTest, WhatCannotBeReachedIsSaidAtOnceByServersAndClients) {
  const TempDir folder;
  const std::string none = folder / "no such, folder";
  const std::string long_name = folder / std::string(200, 'x');
  for (const auto& [path, words] : {std::pair{none + "/a.sock", none}, std::pair{long_name, long_name}}) {
    const std::string address = absl::StrCat("unix:", path);
    const absl::Status served = StartServer({.address = address}, {}).status();
    EXPECT_THAT(std::string(served.message()), HasSubstr(words));
    const grpc::Status called = Check(grpc::health::v1::Health::NewStub(MakeChannel(address)).get());
    EXPECT_EQ(static_cast<int>(called.error_code()), static_cast<int>(served.code()));
    EXPECT_THAT(called.error_message(), HasSubstr(words));
  }
  EXPECT_EQ(SocketPath::Open(none + "/a").status().code(), absl::StatusCode::kNotFound);
  const absl::Status too_long = SocketPath::Open(long_name).status();
  EXPECT_EQ(too_long.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(too_long.message()), HasSubstr("found 200"));
}

TEST(SocketPathTest, APlainPathIsTakenAsItIs) {
  EXPECT_EQ(SocketPath::Open("no/such/folder/a.sock").value()->reachable(), "no/such/folder/a.sock");
  const TempDir folder;
  EXPECT_THAT(SocketPath::Open(folder / "a?").value()->reachable(), StartsWith("/proc/self/fd/"));
}

}  // namespace
}  // namespace dbr
