#include "core/exhaustion.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <system_error>

namespace dbr {
namespace {

void Say(const char* what) {
  std::fprintf(
      stderr,
      "%s: %s. The system gives this program no more: free memory, or raise the limits that `ulimit -a` "
      "shows (-v memory, -u threads, -n open files).\n",
      program_invocation_short_name, what);
}

[[noreturn]] void End() {
  if (const std::exception_ptr thrown = std::current_exception()) {
    try {
      std::rethrow_exception(thrown);
    } catch (const std::bad_alloc&) {
      Say("out of memory");
      _exit(1);
    } catch (const std::system_error& error) {
      Say(error.what());
      _exit(1);
    } catch (...) {  // a programmer's mistake
    }
  }
  std::abort();
}

}  // namespace

void EndWhereResourcesAreExhausted() {
  std::set_terminate(End);
  rlimit files;
  if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur >= kFewestFiles) return;
  Say("too few open files allowed");
  _exit(1);
}

}  // namespace dbr
