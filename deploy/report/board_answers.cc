#include <filesystem>
#include <memory>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/run_folder.h"
#include "core/status_macros.h"
#include "deploy/launch/played_policy.h"
#include "deploy/probe/probe.h"
#include "deploy/report/board_figure.h"
#include "deploy/report/grid.h"
#include "nn/policy_choice.h"

namespace dbr::report {
namespace {

// What the behaviour policy gives the board, as the policy of a snapshot of its own; empty where there is
// none of the policy's shape (over discrete actions both are a softmax over the legal ones).
std::vector<float> AskBehavior(const PolicyNetworks& policy, const connect4::Board& board) {
  const std::vector<float>* behavior = policy.snapshot().Find(kBehavior);
  if (behavior == nullptr) return {};
  PolicySnapshot alone = policy.snapshot();
  alone.networks = {{kPolicyNetwork, *behavior}};
  if (const std::vector<float>* normalizer = policy.snapshot().Find(kObservationNormalizer))
    alone.networks.emplace_back(kObservationNormalizer, *normalizer);
  const auto networks = PolicyNetworks::Create(std::move(alone));
  if (!networks.ok()) return {};
  const auto probed = Probe(**networks, {board}, MODE, 1);
  return probed.ok() ? (*probed)[0].pi : std::vector<float>();
}

}  // namespace

absl::StatusOr<BoardAnswer> AskAboutBoard(const PolicyNetworks& policy, const std::string& label) {
  ASSIGN_OR_RETURN(const connect4::Board board, connect4::Board::FromMoves(kBoardMoves));
  ASSIGN_OR_RETURN(const std::vector<ProbedPosition> probed, Probe(policy, {board}, MODE, 1));
  BoardAnswer answer;
  answer.label = label;
  answer.move = probed[0].move;
  const std::pair<const char*, std::vector<float>> all[] = {{"π", probed[0].pi},
                                                            {"β+", probed[0].beta_plus},
                                                            {"β−", probed[0].beta_minus},
                                                            {"behaviour policy", AskBehavior(policy, board)}};
  for (const auto& [name, probabilities] : all) {
    if (!probabilities.empty()) answer.distributions.push_back({name, probabilities});
  }
  return answer;
}

std::vector<BoardAnswer> BoardAnswers(const Runs& runs, std::vector<std::string>* notes) {
  std::vector<BoardAnswer> answers;
  std::set<int> answered;
  for (const ReportedCell& cell : runs.cells) {
    if (cell.state != ReportedState::kDone || cell.summary.env != "connect4" ||
        answered.count(cell.contender) > 0)
      continue;
    std::error_code ignored;
    if (!std::filesystem::exists(RunFolder{cell.folder}.latest_policy(), ignored)) continue;
    const std::string label =
        absl::StrCat(LabelOf(runs.grid.contender(cell.contender)), ", seed ", cell.seed);
    // The one that the final figures are of; before 0.2.0 there was no choice.
    const auto choice =
        cell.summary.final_policy == NameOf(AVERAGE) ? PlayedChoice::kAverage : PlayedChoice::kRaw;
    const auto policy = OpenPlayedPolicy(cell.folder, choice);
    absl::StatusOr<BoardAnswer> answer =
        policy.ok() ? AskAboutBoard(*policy->networks, label) : policy.status();
    if (!answer.ok()) {
      notes->push_back(absl::StrCat("no bars beside the board for ", label, ": ", answer.status().message()));
      continue;
    }
    answered.insert(cell.contender);
    answers.push_back(*std::move(answer));
  }
  return answers;
}

}  // namespace dbr::report
