#include "proto/rpc/protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "proto/rpc/grpc_status.h"

namespace dbr {
namespace {

TEST(ProtocolTest, TheSameVersionFits) {
  EXPECT_TRUE(CheckProtocolVersion(kProtocolVersion, "the writer actor-0", "the replay server").ok());
}

TEST(ProtocolTest, AnErrorSaysBothVersionsTheOlderProgramAndWhatToDo) {
  const absl::Status old = CheckProtocolVersion(0, "the writer actor-0", "the replay server");
  EXPECT_EQ(
      old.message(),
      absl::StrCat("expected protocol ", kProtocolVersion,
                   ", found 0 (a program from before 0.2.0): the writer actor-0 is older than the replay "
                   "server. Use one release of dbr for both: update the writer actor-0 and start it again."));
  const absl::Status newer = CheckProtocolVersion(kProtocolVersion + 1, "the learner", "this program");
  EXPECT_EQ(
      newer.message(),
      absl::StrCat("expected protocol ", kProtocolVersion, ", found ", kProtocolVersion + 1,
                   ": this program is older than the learner. Use one release of dbr for both: update this "
                   "program and start it again."));
  EXPECT_TRUE(IsFinal(old) && IsFinal(newer));
}

TEST(ProtocolTest, ANameOfAnyLengthFitsIntoAnError) {
  const std::string name(1 << 20, 'x');
  EXPECT_LT(CheckProtocolVersion(0, name, "the replay server").message().size(), 1000u);
}

}  // namespace
}  // namespace dbr
