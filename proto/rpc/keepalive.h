// How soon a connection whose other end has vanished without a word is given up: power lost, a cable pulled.
#pragma once

namespace dbr {

// Either end asks the other after so long without a word, and closes the connection when no answer comes. A
// stream that waits has no deadline of its own; without this it would wait for TCP, a quarter of an hour.
inline constexpr int kKeepaliveTimeMs = 30000;
inline constexpr int kKeepaliveTimeoutMs = 20000;

}  // namespace dbr
