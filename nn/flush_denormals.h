// Treating the smallest numbers as zeros while a network is trained.
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace dbr {

// While it lives, this thread's arithmetic takes and gives 0 in place of denormal numbers (below 1.2e-38 in
// float32). Processors compute with those in microcode, some hundred times slower. Training makes them by the
// thousand: where a hidden unit never fires, its gradient is 0, and after some 800 updates Adam's moments of
// its weights have decayed to denormal numbers, where rounding keeps them for ever. A SAC update then takes
// 1.6 times as long. Does nothing on processors other than x86-64 and ARM64.
class FlushDenormals {
 public:
  FlushDenormals() : before_(Get()) { Set(before_ | kFlush); }
  ~FlushDenormals() { Set(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

  // Whether the calling thread flushes them now.
  static bool Active() { return kFlush != 0 && (Get() & kFlush) == kFlush; }

 private:
#if defined(__x86_64__)
  static constexpr std::uint64_t kFlush = 0x8040;  // results (FTZ) and operands (DAZ)
  static std::uint64_t Get() {
    return _mm_getcsr();
  }
  static void Set(std::uint64_t control) {
    _mm_setcsr(static_cast<unsigned>(control));
  }
#elif defined(__aarch64__)
  static constexpr std::uint64_t kFlush = 1u << 24;  // FPCR.FZ: both
  static std::uint64_t Get() {
    std::uint64_t control;
    asm volatile("mrs %0, fpcr" : "=r"(control));
    return control;
  }
  static void Set(std::uint64_t control) {
    asm volatile("msr fpcr, %0" : : "r"(control));
  }
#else
  static constexpr std::uint64_t kFlush = 0;
  static std::uint64_t Get() {
    return 0;
  }
  static void Set(std::uint64_t) {}
#endif

  const std::uint64_t before_;
};

}  // namespace dbr
