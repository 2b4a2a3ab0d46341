#include "core/exhaustion.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <new>
#include <stdexcept>
#include <system_error>
#include <thread>

namespace dbr {
namespace {

template <class Error>
void ThrowInAThread(const Error& error) {
  EndWhereResourcesAreExhausted();
  std::thread([&error] { throw error; }).join();
}

TEST(ExhaustionDeathTest, EndsWithALineAndNotWithASignal) {
  EXPECT_EXIT(ThrowInAThread(std::bad_alloc()), testing::ExitedWithCode(1),
              "out of memory. The system gives");
  EXPECT_EXIT(ThrowInAThread(std::system_error(EAGAIN, std::generic_category(), "no thread")),
              testing::ExitedWithCode(1), "no thread: Resource temporarily unavailable. The system gives");
}

TEST(ExhaustionDeathTest, TooFewFilesAreSaidAtOnce) {
  const auto begin = [](rlim_t most) {
    const rlimit limit = {most, most};
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0) _exit(9);
    EndWhereResourcesAreExhausted();
    _exit(0);
  };
  EXPECT_EXIT(begin(kFewestFiles - 1), testing::ExitedWithCode(1), "too few open files .* -n open files");
  EXPECT_EXIT(begin(kFewestFiles), testing::ExitedWithCode(0), "");
}

TEST(ExhaustionDeathTest, AProgrammersMistakeStillAborts) {
  EXPECT_EXIT(ThrowInAThread(std::logic_error("a mistake")), testing::KilledBySignal(SIGABRT), "");
}

}  // namespace
}  // namespace dbr
