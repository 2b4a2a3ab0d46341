// Folders such as dbr experiment leaves, for tests of the report.
#pragma once

#include <string>
#include <vector>

#include "deploy/launch/run_summary.h"

namespace dbr {

// Two tasks (hopper-medium offline, connect4 against random and mcts:10), DBR, BEAR and an ablation of DBR on
// hopper-medium alone; at scale short two seeds.
std::string FakeGrid();

// Writes experiment.textproto and scale.txt.
void WriteFakeExperiment(const std::string& root);

// A run of hopper that came to its end with that mean return, its evaluations rising towards it.
RunSummary FakeHopper(double mean_return, std::uint64_t seed);
// A run of games with these final scores, against random and against mcts:10.
RunSummary FakeGames(double random_score, double mcts_score, std::uint64_t seed);

// Writes summary.json and config.textproto of ROOT/TASK/CONTENDER/seed-N, N being the summary's.
void WriteFakeCell(const std::string& root, const std::string& task, const std::string& contender,
                   const RunSummary& summary);

}  // namespace dbr
