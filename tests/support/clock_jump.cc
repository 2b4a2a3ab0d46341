// A library for LD_PRELOAD that sets the time of day of the programs that load it, and nothing else's.
//
// The file named by DBR_CLOCK_JUMP holds eight bytes: nanoseconds (std::int64_t) that are added to the time
// of day from the moment on at which they are written. A wait in the kernel until a time of day is made until
// the same moment without the addition. CLOCK_MONOTONIC is left alone.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <ctime>

namespace {

constexpr std::int64_t kNanos = 1'000'000'000;

const std::atomic<std::int64_t>* Open() {
  static const std::atomic<std::int64_t> none = 0;
  const char* path = std::getenv("DBR_CLOCK_JUMP");
  const int fd = path == nullptr ? -1 : open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return &none;
  void* const page = mmap(nullptr, sizeof(std::int64_t), PROT_READ, MAP_SHARED, fd, 0);
  close(fd);
  return page == MAP_FAILED ? &none : static_cast<const std::atomic<std::int64_t>*>(page);
}

std::int64_t Jump() {
  static const std::atomic<std::int64_t>* const jump = Open();
  return jump->load(std::memory_order_relaxed);
}

timespec Moved(const timespec& time, std::int64_t by) {
  const std::int64_t nanos = std::max<std::int64_t>(0, time.tv_sec * kNanos + time.tv_nsec + by);
  return {nanos / kNanos, nanos % kNanos};
}

template <class Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) {
  static auto* const real = Real<int(clockid_t, timespec*)>("clock_gettime");
  const int result = real(clock, time);
  if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
    *time = Moved(*time, Jump());
  return result;
}

int gettimeofday(timeval* time, void* /*zone*/) {
  timespec now;
  const int result = clock_gettime(CLOCK_REALTIME, &now);
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return result;
}

time_t time(time_t* out) {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (out != nullptr) *out = now.tv_sec;
  return now.tv_sec;
}

// Abseil waits by a futex with an absolute time of day.
long syscall(long number, ...) {
  va_list list;
  va_start(list, number);
  long a[6];
  for (long& argument : a) argument = va_arg(list, long);
  va_end(list);
  static auto* const real = Real<long(long, ...)>("syscall");
  timespec until;
  if (number == SYS_futex && (a[1] & FUTEX_CLOCK_REALTIME) != 0 && a[3] != 0) {
    until = Moved(*reinterpret_cast<const timespec*>(a[3]), -Jump());
    a[3] = reinterpret_cast<long>(&until);
  }
  return real(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

}  // extern "C"
