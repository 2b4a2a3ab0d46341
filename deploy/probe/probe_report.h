// Drawing what a policy says about positions.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "absl/strings/string_view.h"
#include "deploy/probe/positions_file.h"
#include "deploy/probe/probe.h"

namespace dbr {

// A drawing of the board, and of pi, beta+, beta- and Q of each column as bars; of beta in place of beta+ and
// beta- where the policy has one behaviour policy. `moves` led to the position.
std::string PositionText(absl::string_view moves, const ProbedPosition& probed);

// The same in one line, with a small bar for each column and the judgement of the move played.
std::string PositionLine(const ReferencePosition& position, const ProbedPosition& probed);

// The shares with bars, a line each.
std::string SharesText(const ProbeShares& shares);

// {moves, to_move, move, pi, beta_plus, beta_minus, beta, q}: seven entries each, null for a full column, or
// null for a network that the policy lacks; columns count from 1.
nlohmann::ordered_json ToJson(absl::string_view moves, const ProbedPosition& probed);

// {positions, must_block, must_win, keeps_value_decisive, best}.
nlohmann::ordered_json ToJson(const ProbeShares& shares);

}  // namespace dbr
