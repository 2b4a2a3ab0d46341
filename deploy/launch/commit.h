// Which state of the sources these programs were built from.
#pragma once

namespace dbr {

// The commit in full, with "+changes" behind it where files that git tracks differed from it when the
// programs were linked; "unknown" outside a checkout.
const char* BuildCommit();

}  // namespace dbr
