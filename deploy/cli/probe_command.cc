#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/common_options.h"
#include "deploy/probe/positions_file.h"
#include "deploy/probe/probe.h"
#include "deploy/probe/probe_report.h"

namespace dbr {
namespace {

struct ProbeFlags {
  std::string policy;
  std::string which;
  std::string positions;
  std::optional<std::string> moves;
  std::string mode = "mode";
  std::uint64_t seed = 1;
  bool json = false;
};

absl::Status ProbeMoves(const ProbeFlags& flags, const PolicyNetworks& policy, ActingMode mode) {
  const absl::StatusOr<connect4::Board> board = connect4::Board::FromMoves(*flags.moves);
  if (!board.ok()) return absl::InvalidArgumentError(absl::StrCat("--", board.status().message()));
  ASSIGN_OR_RETURN(const std::vector<ProbedPosition> probed, Probe(policy, {*board}, mode, flags.seed));
  const std::string text =
      flags.json ? ToJson(*flags.moves, probed[0]).dump() + "\n" : PositionText(*flags.moves, probed[0]);
  std::fputs(text.c_str(), stdout);
  return absl::OkStatus();
}

absl::Status ProbeFile(const ProbeFlags& flags, const PolicyNetworks& policy, ActingMode mode) {
  ASSIGN_OR_RETURN(const std::vector<ReferencePosition> positions, LoadPositions(flags.positions));
  std::vector<connect4::Board> boards;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const absl::StatusOr<connect4::Board> board = connect4::Board::FromMoves(positions[i].moves);
    if (!board.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(flags.positions, ": positions[", i, "].moves: ", board.status().message()));
    }
    boards.push_back(*board);
  }
  ASSIGN_OR_RETURN(const std::vector<ProbedPosition> probed, Probe(policy, boards, mode, flags.seed));
  const ProbeShares shares = ScoreMoves(positions, probed);
  if (flags.json) {
    std::printf("%s\n", ToJson(shares).dump().c_str());
    return absl::OkStatus();
  }
  for (std::size_t i = 0; i < positions.size(); ++i)
    std::printf("%s\n", PositionLine(positions[i], probed[i]).c_str());
  std::printf("columns from 1 to 7; ✓ a best move, ~ keeps the value, ✗ gives it away; × a full column\n\n%s",
              SharesText(shares).c_str());
  return absl::OkStatus();
}

absl::Status RunProbe(const ProbeFlags& flags) {
  if (flags.positions.empty() == !flags.moves.has_value()) {
    return absl::InvalidArgumentError("expected one of --positions FILE and --moves COLUMNS");
  }
  ASSIGN_OR_RETURN(const ActingMode mode, ParseActingMode(flags.mode));
  ASSIGN_OR_RETURN(const PlayedPolicy policy, OpenNamedPolicy(flags.policy, flags.which));
  return flags.moves.has_value() ? ProbeMoves(flags, *policy.networks, mode)
                                 : ProbeFile(flags, *policy.networks, mode);
}

}  // namespace

void AddProbe(CLI::App* app, int* exit_code) {
  auto flags = std::make_shared<ProbeFlags>();
  CLI::App* command =
      app->add_subcommand("probe", "Show what a Connect-4 policy thinks of positions, and how much is right");
  AddPolicyOption(command, &flags->policy);
  AddWhichOption(command, &flags->which);
  command
      ->add_option("--positions", flags->positions,
                   "JSON file of positions with their exact values, as in tests/reference/connect4")
      ->type_name("FILE");
  command
      ->add_option("--moves", flags->moves,
                   "One position: the columns, 1 to 7, that were played from the empty board on")
      ->type_name("COLUMNS");
  AddModeOption(command, "How the policy chooses the move that is judged", &flags->mode);
  AddSeedOption(command, "Random seed, for the mode sample", &flags->seed);
  command->add_flag("--json", flags->json,
                    "Print one JSON object: with --positions {positions, must_block, must_win, "
                    "keeps_value_decisive, best}, "
                    "with --moves {moves, to_move, move, pi, beta_plus, beta_minus, beta, q}");
  command->footer(
      "Examples:\n"
      "  dbr probe --policy runs/quickstart --moves 44536\n"
      "  dbr probe --policy runs/quickstart --positions tests/reference/connect4/tactics.train.json --json");
  command->callback([flags, exit_code] {
    const absl::Status status = RunProbe(*flags);
    *exit_code = status.ok() ? 0 : Fail("probe", status);
  });
}

}  // namespace dbr
