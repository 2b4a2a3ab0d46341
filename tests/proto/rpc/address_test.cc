#include "proto/rpc/address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dbr {
namespace {

using testing::HasSubstr;

TEST(AddressTest, ReadsHostsWithPorts) {
  struct Case {
    const char* text;
    const char* host;
    int port;
  };
  for (const Case& one :
       {Case{"127.0.0.1:80", "127.0.0.1", 80}, Case{"localhost:0", "localhost", 0},
        Case{"node-7.cluster_a:65535", "node-7.cluster_a", 65535}, Case{"[::1]:80", "::1", 80},
        Case{"[fe80::1%eth0]:1", "fe80::1%eth0", 1}, Case{"0.0.0.0:00080", "0.0.0.0", 80}}) {
    const auto address = ParseAddress(one.text);
    ASSERT_TRUE(address.ok()) << address.status();
    EXPECT_FALSE(address->is_unix());
    EXPECT_EQ(address->host, one.host);
    EXPECT_EQ(address->port, one.port);
  }
}

TEST(AddressTest, TakesAPathByteForByte) {
  for (const char* path : {"a.sock", "/run/a b/%41?x#y/a.sock", "runs/a,b/replay.sock", "/r/\x01\xff/a"}) {
    const auto address = ParseAddress(std::string("unix:") + path);
    ASSERT_TRUE(address.ok()) << address.status();
    EXPECT_TRUE(address->is_unix());
    EXPECT_EQ(address->path, path);
  }
  EXPECT_EQ(ParseAddress("unix:///run/a.sock")->path, "/run/a.sock");
}

TEST(AddressTest, RefusesWhatIsNone) {
  for (const char* text : {"127.0.0.1:99999",
                           "127.0.0.1:65536",
                           "127.0.0.1:-1",
                           "127.0.0.1:+1",
                           "127.0.0.1:1e3",
                           "127.0.0.1:80 ",
                           "127.0.0.1: 80",
                           "127.0.0.1:",
                           "127.0.0.1:0x50",
                           "127.0.0.1:18446744073709551696",
                           "[::1]",
                           "::1:80",
                           "[::1]80",
                           "[::1:80",
                           "::1]:80",
                           "[127.0.0.1]:80",
                           "[::1%]:80",
                           ":80",
                           "host",
                           "",
                           ":",
                           "a host:80",
                           "host/x:80",
                           "300.0.0.1:80",
                           "127.0.0.1.5:80",
                           "1:80",
                           "http://host:80",
                           "unix:",
                           "unix://",
                           "unix:///",
                           "unix://host/x",
                           "unix:/run/",
                           "unix:/run/a,b.sock",
                           "unix-abstract:",
                           "unix-abstract:name",
                           "unix-abstract:80",
                           "ipv4:127.0.0.1:80"}) {
    const absl::Status status = ParseAddress(text).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(std::string(status.message()), HasSubstr(std::string("'") + text + "'"));
    EXPECT_THAT(std::string(status.message()), HasSubstr("expected unix:PATH or HOST:PORT"));
  }
  EXPECT_FALSE(ParseAddress(absl::string_view("unix:a\0b", 8)).ok());
}

TEST(AddressTest, AClientCannotAskForPortZero) {
  EXPECT_EQ(ParseClientAddress("127.0.0.1:0").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(ParseClientAddress("127.0.0.1:1").ok());
  EXPECT_TRUE(ParseClientAddress("unix:a:0").ok());
}

TEST(AddressTest, KnowsWhatOnlyThisMachineReaches) {
  for (const char* local : {"unix:a", "127.0.0.1:1", "127.9.9.9:1", "localhost:1", "LocalHost:1", "[::1]:1",
                            "[0:0:0:0:0:0:0:1]:1"})
    EXPECT_TRUE(ParseAddress(local)->is_local()) << local;
  for (const char* other : {"0.0.0.0:1", "[::]:1", "192.0.2.1:1", "127.example.org:1", "localhost.org:1"})
    EXPECT_FALSE(ParseAddress(other)->is_local()) << other;
}

}  // namespace
}  // namespace dbr
