// Fields of a config that are each within their bounds but do not fit together.
#pragma once

#include <string>
#include <vector>

#include "proto/config.pb.h"

namespace dbr {

// Appends an error for each combination of fields that has no meaning or contradicts itself. An error names
// the fields, what was expected and what was found.
void FindContradictions(const Config& config, std::vector<std::string>* errors);

}  // namespace dbr
