// How soon a connection is given up whose other end has vanished without a word (power lost, a cable pulled).
#pragma once

namespace dbr {

// Each end asks the other after kKeepaliveTimeMs without a word, and closes the connection when no answer has
// come within kKeepaliveTimeoutMs. A stream that waits has no deadline of its own: without this it would wait
// for TCP, which takes a quarter of an hour. Both in milliseconds.
inline constexpr int kKeepaliveTimeMs = 30000;
inline constexpr int kKeepaliveTimeoutMs = 20000;

}  // namespace dbr
