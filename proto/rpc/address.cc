#include "proto/rpc/address.h"

#include <arpa/inet.h>

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr char kForms[] = ": expected unix:PATH or HOST:PORT, for example 127.0.0.1:0; found ";
constexpr int kMostPort = 65535;

absl::Status Wrong(absl::string_view text, absl::string_view found) {
  return absl::InvalidArgumentError(absl::StrCat("address '", text, "'", kForms, found));
}

absl::StatusOr<Address> ParseUnix(absl::string_view text, absl::string_view path) {
  // gRPC's form with an empty authority; what stands in its place would be another machine's name.
  if (absl::ConsumePrefix(&path, "//") && !absl::StartsWith(path, "/")) {
    return Wrong(text, "no path behind unix://");
  }
  if (path.empty() || path.back() == '/') return Wrong(text, "no name of a socket behind unix:");
  if (absl::StrContains(path, '\0')) return Wrong(text, "a zero byte in the path");
  // gRPC splits lists at commas after it has decoded them. Those in the folders' names never reach it.
  if (absl::StrContains(path.substr(path.rfind('/') + 1), ',')) {
    return Wrong(text, "a comma in the name of the socket; choose a name without");
  }
  return Address{.path = std::string(path), .host = {}, .port = 0};
}

bool IsIpv6(std::string host) {
  // A link-local address names the interface behind a '%'.
  if (const std::size_t zone = host.find('%'); zone != std::string::npos) {
    const auto fits = [](char c) { return absl::ascii_isalnum(static_cast<unsigned char>(c)) != 0; };
    if (zone + 1 == host.size() || !std::all_of(host.begin() + zone + 1, host.end(), fits)) return false;
    host.resize(zone);
  }
  in6_addr parsed;
  return inet_pton(AF_INET6, host.c_str(), &parsed) == 1;
}

bool IsIpv4(const std::string& host) {
  in_addr parsed;
  return inet_pton(AF_INET, host.c_str(), &parsed) == 1;
}

// Whether it can name a machine. What has digits and dots alone must be a whole IPv4 address.
bool IsHostName(const std::string& host) {
  const auto fits = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == '_';
  };
  const auto numeric = [](char c) { return absl::ascii_isdigit(static_cast<unsigned char>(c)) || c == '.'; };
  if (host.empty() || !std::all_of(host.begin(), host.end(), fits)) return false;
  return IsIpv4(host) || !std::all_of(host.begin(), host.end(), numeric);
}

absl::StatusOr<std::string> ParseHost(absl::string_view text, absl::string_view host) {
  if (host.empty()) return Wrong(text, "no host before the port");
  if (absl::ConsumePrefix(&host, "[")) {
    if (absl::ConsumeSuffix(&host, "]") && IsIpv6(std::string(host))) return std::string(host);
    return Wrong(text, "no IPv6 address in brackets");
  }
  if (absl::StrContains(host, ':')) {
    return Wrong(text, "more than one colon; an IPv6 address stands in brackets, as in [::1]:80");
  }
  if (IsHostName(std::string(host))) return std::string(host);
  return Wrong(text, absl::StrCat("the host '", host, "', which is no name and no IPv4 address"));
}

}  // namespace

bool Address::is_local() const {
  if (is_unix()) return true;
  in_addr v4;
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return ntohl(v4.s_addr) >> 24 == 127;
  in6_addr v6;
  if (inet_pton(AF_INET6, host.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6);
  return absl::EqualsIgnoreCase(host, "localhost");
}

absl::StatusOr<Address> ParseAddress(absl::string_view text) {
  if (absl::string_view path = text; absl::ConsumePrefix(&path, "unix:")) return ParseUnix(text, path);
  if (absl::StartsWith(text, "unix-abstract:")) return Wrong(text, "an abstract socket, which has no path");
  const std::size_t colon = text.rfind(':');
  if (colon == absl::string_view::npos) return Wrong(text, "no port");
  Address address;
  const absl::string_view port = text.substr(colon + 1);
  if (absl::EndsWith(text, "]")) return Wrong(text, "no port behind the brackets");
  ASSIGN_OR_RETURN(address.host, ParseHost(text, text.substr(0, colon)));
  const bool digits = !port.empty() && std::all_of(port.begin(), port.end(), [](char c) {
    return absl::ascii_isdigit(static_cast<unsigned char>(c)) != 0;
  });
  if (!digits || !absl::SimpleAtoi(port, &address.port) || address.port > kMostPort) {
    return Wrong(text, absl::StrCat("port '", port, "', which is none of 0 to ", kMostPort));
  }
  return address;
}

absl::StatusOr<Address> ParseClientAddress(absl::string_view text) {
  ASSIGN_OR_RETURN(Address address, ParseAddress(text));
  if (address.is_unix() || address.port != 0) return address;
  return Wrong(text, "port 0, by which a server picks one; name the port that it said");
}

absl::Status CheckServerAddress(absl::string_view text, bool allow_insecure) {
  ASSIGN_OR_RETURN(const Address address, ParseAddress(text));
  if (allow_insecure || address.is_local()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("address '", text,
                   "' can be reached from other machines and there is no authentication yet: "
                   "use a unix socket or 127.0.0.1, or say --allow-insecure on a network that you trust."));
}

}  // namespace dbr
