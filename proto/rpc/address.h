// Where a service is, as configs and flags say it.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace dbr {

// An address that ParseAddress accepted. Plain values.
struct Address {
  std::string path;  // of a unix socket; empty: the address is host and port
  std::string host;  // "127.0.0.1", "::1" or a name
  int port = 0;      // 0: a server picks a free one

  bool is_unix() const { return !path.empty(); }
  // Whether only this machine can reach it: a unix socket, 127.x.y.z, ::1 or localhost. A name that only
  // begins like one of these may be anybody's.
  bool is_local() const;
};

// Reads "unix:PATH" (also "unix:///PATH") or "HOST:PORT". PATH is taken byte for byte: nothing in it is
// decoded. HOST is an IPv4 address, an IPv6 address in brackets or a name; PORT is 0 to 65535, in digits.
// InvalidArgument says what was expected and found.
absl::StatusOr<Address> ParseAddress(absl::string_view text);

// ParseAddress for a client, which cannot ask for port 0.
absl::StatusOr<Address> ParseClientAddress(absl::string_view text);

// Checks that a server may be told to serve at `text`. InvalidArgument for an address that is none, and for
// one that other machines can reach unless `allow_insecure`.
absl::Status CheckServerAddress(absl::string_view text, bool allow_insecure);

}  // namespace dbr
