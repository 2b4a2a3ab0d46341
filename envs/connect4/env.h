// Connect-4 as an environment of one learning agent.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/rng.h"
#include "envs/connect4/board.h"
#include "envs/connect4/opponents.h"
#include "envs/env.h"

namespace dbr::connect4 {

// Owns its opponents. One thread at a time. The opponent's reply is part of the step, so an episode has at
// most 21 steps and never meets a time limit. The random seed of an episode decides everything but the
// agent's moves. The agent starts if the random seed is even, the opponent if it is odd, so consecutive seeds
// alternate. Where there are several opponents, the random seed draws one of them.
//
// A share of the episodes may begin in the middle: at a position of a game of uniformly random moves that has
// not ended, after a number of its moves that is drawn at random. The agent is to move there. Late positions
// and open threats are then as frequent as early ones, where games against a weak opponent end before them.
//
// The observation [84] and the mask [7] are those of WriteObservation in board.h. Plane 0 always has the
// agent's stones, also in the final observation, whose mask is zero. The action is the column, 0 to 6. The
// step that ends the game gives reward 1, 0 or -1 and score 1, 0.5 or 0 for a won, drawn or lost game.
// Earlier steps give reward 0.
class Connect4Env : public Env {
 public:
  // `opponents` are names of opponents.h; without any the opponent is random. `random_start_share`, from 0 to
  // 1, is the share of episodes that begin in the middle. Returns InvalidArgument for a name that
  // MakeOpponent refuses.
  static absl::StatusOr<std::unique_ptr<Env>> Make(const std::vector<std::string>& opponents,
                                                   double random_start_share = 0);

  const EnvSpec& spec() const override { return spec_; }
  void Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float> mask) override;
  StepResult Step(absl::Span<const float> action, absl::Span<float> observation,
                  absl::Span<float> mask) override;

 private:
  Connect4Env(std::vector<std::unique_ptr<Opponent>> opponents, double random_start_share);

  const EnvSpec spec_;
  const std::vector<std::unique_ptr<Opponent>> opponents_;
  const double random_start_share_;
  Opponent* opponent_ = nullptr;  // this episode's opponent; null before the first episode
  Rng rng_{0};
  Board board_;
};

}  // namespace dbr::connect4
