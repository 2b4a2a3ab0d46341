// What a replay server says about itself, for people and for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "proto/replay.pb.h"

namespace dbr {

std::string StatsText(const std::string& address, const StatsReply& stats);

// One object whose names are those of StatsReply's fields; null for what is not a number.
nlohmann::ordered_json ToJson(const StatsReply& stats);

}  // namespace dbr
