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

// The opponent's reply is part of the step, so an episode has at most 21 steps and never meets a time limit.
// The seed of an episode decides everything but the agent's moves: the agent starts if the seed is even, the
// opponent if it is odd (consecutive seeds alternate), and of several opponents one is drawn.
//
// Observation [84] and mask [7] as WriteObservation in board.h, plane 0 being the agent's stones, also in the
// final one, whose mask is zero. Action: the column, 0 to 6. Reward 1, 0 or -1 and score 1, 0.5 or 0 for a
// won, drawn or lost game with the step that ends it; 0 before.
class Connect4Env : public Env {
 public:
  // `opponents`: names of opponents.h; none means random. InvalidArgument for a name that MakeOpponent
  // refuses.
  static absl::StatusOr<std::unique_ptr<Env>> Make(const std::vector<std::string>& opponents);

  const EnvSpec& spec() const override { return spec_; }
  void Reset(std::uint64_t seed, absl::Span<float> observation, absl::Span<float> mask) override;
  StepResult Step(absl::Span<const float> action, absl::Span<float> observation,
                  absl::Span<float> mask) override;

 private:
  explicit Connect4Env(std::vector<std::unique_ptr<Opponent>> opponents);

  const EnvSpec spec_;
  const std::vector<std::unique_ptr<Opponent>> opponents_;
  Opponent* opponent_ = nullptr;  // of this episode; null before the first
  Rng rng_{0};
  Board board_;
};

}  // namespace dbr::connect4
