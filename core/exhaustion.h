// A clean end where the system gives no more memory, threads or files.
#pragma once

namespace dbr {

// The fewest open files (`ulimit -n`) that a program needs: with less gRPC ends it by a signal.
inline constexpr int kFewestFiles = 64;

// From now on an exception that nobody catches, in any thread, ends the program with a line on stderr and
// exit status 1, and not with a signal and a core file. Our code throws nothing: what comes here are the
// standard library's std::bad_alloc, where memory is out, and std::system_error, where no thread can be
// started. Belongs in the first lines of main.
// Where the limit of `ulimit -n` is below kFewestFiles the program ends in this way at once.
void EndWhereResourcesAreExhausted();

}  // namespace dbr
