// A clean end where the system gives no more memory, threads or files.
#pragma once

namespace dbr {

// From now on an exception that nobody catches, in any thread, ends the program with a line on stderr and
// exit status 1, and not with a signal and a core file. Our code throws nothing: what comes here are the
// standard library's std::bad_alloc, where memory is out, and std::system_error, where no thread can be
// started. Belongs in the first lines of main.
// Where the limit of `ulimit -n` is below kFewestFiles it ends the program in this way at once, for gRPC
// would end it by a signal.
inline constexpr int kFewestFiles = 64;
void EndWhereResourcesAreExhausted();

}  // namespace dbr
