#include "tests/learner/algorithms/allocation_count.h"

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <dnnl.hpp>

namespace dbr {
namespace {

std::atomic<std::uint64_t> count{0};
thread_local bool in_onednn = false;

void CountOne() {
  if (!in_onednn) count.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

std::uint64_t AllocationCount() {
  return count.load(std::memory_order_relaxed);
}

}  // namespace dbr

// oneDNN puts the arguments of each execution into a map of its own. The linker sends our calls here (its
// option --wrap in CMakeLists.txt); creating a primitive still counts.
extern "C" {
dnnl_status_t __real_dnnl_primitive_execute(const_dnnl_primitive_t primitive, dnnl_stream_t stream, int count,
                                            const dnnl_exec_arg_t* arguments);
dnnl_status_t __wrap_dnnl_primitive_execute(const_dnnl_primitive_t primitive, dnnl_stream_t stream, int count,
                                            const dnnl_exec_arg_t* arguments) {
  dbr::in_onednn = true;
  const dnnl_status_t status = __real_dnnl_primitive_execute(primitive, stream, count, arguments);
  dbr::in_onednn = false;
  return status;
}
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)

bool dbr::CountsAllocations() {
  return false;
}

#else

bool dbr::CountsAllocations() {
  return true;
}

// The internal names of glibc's allocator. The functions below take its public names.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  dbr::CountOne();
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  dbr::CountOne();
  return __libc_calloc(n, size);
}
void* realloc(void* old, std::size_t size) {
  dbr::CountOne();
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  dbr::CountOne();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  dbr::CountOne();
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
}

#endif
