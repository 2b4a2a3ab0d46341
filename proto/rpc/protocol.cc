#include "proto/rpc/protocol.h"

#include "absl/strings/str_cat.h"

namespace dbr {

absl::Status CheckProtocolVersion(std::uint32_t found, absl::string_view sender, absl::string_view reader) {
  if (found == kProtocolVersion) return absl::OkStatus();
  constexpr std::size_t kLongestName = 80;  // a sender's name may come from the wire, and of any length
  sender = sender.substr(0, kLongestName);
  const bool sender_is_older = found < kProtocolVersion;
  const absl::string_view older = sender_is_older ? sender : reader;
  return absl::FailedPreconditionError(
      absl::StrCat("expected protocol ", kProtocolVersion, ", found ", found,
                   found == 0 ? " (a program from before 0.2.0)" : "", ": ", older, " is older than ",
                   sender_is_older ? reader : sender, ". Use one release of dbr for both: update ", older,
                   " and start it again."));
}

}  // namespace dbr
