#include "proto/rpc/grpc_status.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "proto/rpc/exit_status.h"

namespace dbr {
namespace {

using absl::StatusCode;

TEST(IsFinalTest, EveryErrorIsEitherFinalOrWorthAnotherTry) {
  const std::set<StatusCode> final = {StatusCode::kInvalidArgument,    StatusCode::kOutOfRange,
                                      StatusCode::kNotFound,           StatusCode::kAlreadyExists,
                                      StatusCode::kUnimplemented,      StatusCode::kPermissionDenied,
                                      StatusCode::kFailedPrecondition, StatusCode::kUnauthenticated};
  const std::set<StatusCode> passing = {
      StatusCode::kOk,      StatusCode::kCancelled,   StatusCode::kUnknown,  StatusCode::kDeadlineExceeded,
      StatusCode::kAborted, StatusCode::kUnavailable, StatusCode::kInternal, StatusCode::kResourceExhausted,
      StatusCode::kDataLoss};
  EXPECT_EQ(final.size() + passing.size(), 17u) << "all codes of gRPC";
  for (const StatusCode code : final) EXPECT_TRUE(IsFinal(absl::Status(code, "why"))) << code;
  for (const StatusCode code : passing) EXPECT_FALSE(IsFinal(absl::Status(code, "why"))) << code;
}

TEST(GrpcStatusTest, CodeAndMessageSurviveTheWayThereAndBack) {
  const absl::Status status = absl::FailedPreconditionError("expected protocol 2, found 0");
  EXPECT_EQ(FromGrpc(ToGrpc(status)), status);
  EXPECT_TRUE(FromGrpc(ToGrpc(absl::OkStatus())).ok());
}

TEST(GrpcStatusTest, AServerWithoutTheServiceIsTakenForAnotherProgram) {
  const absl::Status status = FromGrpc(grpc::Status(grpc::StatusCode::UNIMPLEMENTED, ""));
  EXPECT_TRUE(IsFinal(status));
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("another program"));
}

TEST(ExitStatusTest, SaysWhetherAnotherStartMayHelp) {
  EXPECT_EQ(ExitStatusOf(absl::OkStatus()), 0);
  EXPECT_EQ(ExitStatusOf(absl::InvalidArgumentError("another width")), kFinalExit);
  EXPECT_EQ(ExitStatusOf(absl::FailedPreconditionError("another protocol")), kFinalExit);
  EXPECT_EQ(ExitStatusOf(absl::DataLossError("a damaged file")), kFinalExit);
  EXPECT_EQ(ExitStatusOf(absl::UnavailableError("away")), 1);
  EXPECT_EQ(ExitStatusOf(absl::InternalError("not finite")), 1);
  EXPECT_EQ(ExitStatusOf(absl::ResourceExhaustedError("the disk is full")), 1);
}

}  // namespace
}  // namespace dbr
