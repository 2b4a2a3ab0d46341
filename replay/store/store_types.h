// What a store is made with, and what it keeps of a row beside its floats, as plain values.
#pragma once

#include <cstdint>
#include <string>

#include "core/transition.h"
#include "replay/store/writer_table.h"

namespace dbr {

struct StoreOptions {
  std::string path;  // of the file; empty: memory alone
  std::string env;   // name of the environment that the transitions come from
  TransitionLayout layout;
  std::uint64_t capacity = 0;      // rows
  std::uint64_t byte_budget = 0;   // for rows, labels and indices; 0: what the capacity needs
  bool resume = false;             // continue the file at `path`
  std::uint64_t memory_bytes = 0;  // of the machine; 0: asks the system
};

// The labels of a row, which the store keeps beside its floats.
struct RowLabels {
  std::uint64_t sequence = 0;        // the writer's number of the row
  std::uint64_t critic_version = 0;  // of the critic that gave the advantage
  float advantage = kUnjudged;
  std::uint32_t writer = 0;  // its place in the table of writers
  Source source = Source::kOnline;
};

}  // namespace dbr
