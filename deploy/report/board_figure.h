// The paper's Connect-4 figure: a board, and what policies and their behaviour policies make of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "deploy/report/cells.h"
#include "nn/policy_networks.h"

namespace dbr::report {

// Red (the first player) is to move, and Yellow has three stones in the right-most column: whatever else Red
// plays loses at once, and Red has no win of its own.
inline constexpr char kBoardMoves[] = "474727";

// A contender's answer to the board; distributions over the seven columns.
struct BoardAnswer {
  std::string label;  // "DBR, seed 1"
  int move = 0;       // that it plays, from 0
  struct Distribution {
    std::string label;
    std::vector<float> probabilities;
  };
  // pi, and those of beta+, beta- and the behaviour policy that the policy has.
  std::vector<Distribution> distributions;
};

// Asks a policy. InvalidArgument for a policy of another environment.
absl::StatusOr<BoardAnswer> AskAboutBoard(const PolicyNetworks& policy, const std::string& label);

// The answer of the first finished run of each contender whose newest policy file is there. Contenders
// without one are left out; files that cannot be read are named in `notes`.
std::vector<BoardAnswer> BoardAnswers(const Runs& runs, std::vector<std::string>* notes);

// The board on the left, a row of bars for each answer on its right.
std::string BoardFigure(const std::vector<BoardAnswer>& answers);

}  // namespace dbr::report
