// Counts the allocations of the whole program.
#pragma once

#include <cstdint>

namespace dbr {

// Whether this build counts. A build with a sanitizer does not, because the sanitizer has an allocator of its
// own.
bool CountsAllocations();

// The number of calls of malloc, calloc, realloc and their aligned versions so far, in all threads, without
// those that oneDNN makes inside of dnnl_primitive_execute.
std::uint64_t AllocationCount();

}  // namespace dbr
