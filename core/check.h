// DBR_CHECK(condition) prints the condition and aborts where it is false. It is for programmers' mistakes
// alone: what input, network or disk can cause is an absl::Status.
#pragma once

#include <cstdio>
#include <cstdlib>

#define DBR_CHECK(condition)                                                             \
  do {                                                                                   \
    if (!(condition)) [[unlikely]] {                                                     \
      std::fprintf(stderr, "%s:%d: check failed: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                      \
    }                                                                                    \
  } while (false)
