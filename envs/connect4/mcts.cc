#include "envs/connect4/mcts.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/check.h"

namespace dbr::connect4 {
namespace {

constexpr float kExploration = 2.0f;  // the constant c of UCT

}  // namespace

TreeSearch::TreeSearch(int simulations)
    : simulations_(simulations), exploration_(simulations + 1), inverse_root_(simulations + 1), nodes_(1) {
  DBR_CHECK(simulations >= 1 && simulations <= kMaxSimulations);
  for (int n = 1; n <= simulations; ++n) {
    exploration_[n] = kExploration * std::sqrt(std::log(static_cast<float>(n)));
    inverse_root_[n] = 1.0f / std::sqrt(static_cast<float>(n));
  }
}

int TreeSearch::ChooseColumn(const Board& board, Rng& rng) {
  DBR_CHECK(!board.IsOver());
  ChoiceStream choices(rng);
  nodes_.assign(1, Node());
  for (int i = 0; i < simulations_ && nodes_[0].proven == kUnproven; ++i) Simulate(board, choices);
  // After a single simulation the root has no children.
  if (nodes_[0].children == 0) Expand(0, board, choices);
  return nodes_[ChildToPlay()].landing_bit / kColumnStride;
}

int TreeSearch::Visits(int column) const {
  const Node& root = nodes_.front();
  for (std::int32_t i = root.first_child; i < root.first_child + root.children; ++i) {
    if (nodes_[i].landing_bit / kColumnStride == column) return nodes_[i].visits;
  }
  return 0;
}

void TreeSearch::Simulate(Board board, ChoiceStream& choices) {
  std::int32_t index = 0;
  path_.assign(1, index);
  while (nodes_[index].visits > 0 && nodes_[index].proven == kUnproven) {
    if (nodes_[index].children == 0) Expand(index, board, choices);
    index = BestChild(nodes_[index]);
    board.PlayCell(Cells{1} << nodes_[index].landing_bit);
    path_.push_back(index);
  }
  Node& leaf = nodes_[index];
  int outcome = leaf.proven != kUnproven ? leaf.proven : FirstVisit(leaf, board, choices);
  bool proven = leaf.proven != kUnproven;
  for (auto step = path_.rbegin(); step != path_.rend(); ++step, outcome = -outcome) {
    Node& node = nodes_[*step];
    ++node.visits;
    node.outcomes += outcome;
    if (proven && node.proven == kUnproven) proven = ProveFromChildren(node);
  }
}

int TreeSearch::FirstVisit(Node& node, const Board& board, ChoiceStream& choices) {
  if (board.LastMoveWon()) return node.proven = 1;
  if (board.IsFull()) return node.proven = 0;
  return -RandomPlayout(board, choices);
}

void TreeSearch::Expand(std::int32_t index, const Board& board, ChoiceStream& choices) {
  const auto first = static_cast<std::int32_t>(nodes_.size());
  for (Cells cells = board.landing_cells(); cells != 0;) {
    const Cells cell = choices.SetBit(cells);
    cells ^= cell;
    nodes_.emplace_back().landing_bit = static_cast<std::int8_t>(std::countr_zero(cell));
  }
  nodes_[index].first_child = first;
  nodes_[index].children = static_cast<std::int8_t>(nodes_.size() - first);
}

std::int32_t TreeSearch::BestChild(const Node& node) const {
  std::int32_t best = node.first_child;
  float best_value = -std::numeric_limits<float>::infinity();
  const float exploration = exploration_[node.visits];
  for (std::int32_t i = node.first_child; i < node.first_child + node.children; ++i) {
    const Node& child = nodes_[i];
    if (child.visits == 0) return i;
    const float root = inverse_root_[child.visits];
    const float value = child.proven != kUnproven
                            ? static_cast<float>(child.proven)
                            : (static_cast<float>(child.outcomes) * root + exploration) * root;
    if (value > best_value) {
      best_value = value;
      best = i;
    }
  }
  return best;
}

bool TreeSearch::ProveFromChildren(Node& node) const {
  int best = -1;
  bool all = true;
  for (std::int32_t i = node.first_child; i < node.first_child + node.children; ++i) {
    if (nodes_[i].proven == kUnproven) {
      all = false;
    } else {
      best = std::max<int>(best, nodes_[i].proven);
    }
  }
  if (!all && best < 1) return false;
  node.proven = static_cast<std::int8_t>(-best);
  return true;
}

std::int32_t TreeSearch::ChildToPlay() const {
  const auto rank = [this](std::int32_t i) {
    const Node& child = nodes_[i];
    return std::make_tuple(child.proven == kUnproven ? 0 : child.proven, child.visits, child.outcomes);
  };
  std::int32_t best = nodes_[0].first_child;
  for (std::int32_t i = best + 1; i < nodes_[0].first_child + nodes_[0].children; ++i) {
    if (rank(i) > rank(best)) best = i;
  }
  return best;
}

}  // namespace dbr::connect4
