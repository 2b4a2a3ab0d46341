// What `dbr dataset` says of a file.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "replay/dataset/dataset_facts.h"
#include "replay/dataset/dataset_layout.h"

namespace dbr {

struct DatasetReport {
  std::string path;
  std::string env;  // empty: the file does not say
  DatasetLayout layout = DatasetLayout::kD4rl;
  DatasetFacts facts;
};

// A line for each fact, the distribution of the returns as bars, and a line for each warning
// (replay/dataset/dataset_facts.h).
std::string DatasetText(const DatasetReport& report);

// {layout, rows, transitions, episodes, terminals, timeouts, non_finite, bad_flags, return: {mean, std, min,
// max}, actions_outside, warnings: [text]}. `non_finite` counts all bad rows, `bad_flags` those among them
// with a flag that is neither 0 nor 1. The figures of the return are null where no episode ended.
nlohmann::ordered_json DatasetJson(const DatasetReport& report);

}  // namespace dbr
