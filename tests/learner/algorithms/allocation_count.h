// Counting what the whole program allocates.
#pragma once

#include <cstdint>

namespace dbr {

// Whether this build counts: not under a sanitizer, which has an allocator of its own.
bool CountsAllocations();

// Calls of malloc, calloc, realloc and the aligned ones so far, of all threads.
std::uint64_t AllocationCount();

}  // namespace dbr
