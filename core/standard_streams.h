// The streams that a program is started with.
#pragma once

#include <string>

namespace dbr {

// Gives a place to each of stdin, stdout and stderr that was closed by whoever started the program, so that
// no file or socket that is opened later takes its number and is written to by mistake. Writing to such a
// stdout fails. Belongs in the first lines of main, before threads.
void HoldStandardStreams();

// Flushes stdout. Empty where everything that was printed has arrived; else why it has not. `reader_gone`:
// the reader of a pipe went away first, which is its right (`dbr algorithms | head -1`). Call it once, at the
// end.
std::string LostOutput(bool* reader_gone);

}  // namespace dbr
