#include "envs/connect4/presentation.h"

#include "envs/connect4/opponents.h"

namespace dbr::connect4 {

EnvPresentation Presentation() {
  return {.episodes = "games",
          .short_episodes = "games",
          .opponents = kOpponentNames,
          .scoring = "A win counts 1, a draw 0.5; each side starts half of the games.",
          .watched = {{"random", "rnd"}, {"mcts:10", "mcts"}},
          .published = {{"dbr", "DBR", {{"random", 0.982, 0.0158}, {"mcts:10", 0.912, 0.0793}}},
                        {"bear", "BEAR", {{"random", 0.967, 0.116}, {"mcts:10", 0.75, 0.187}}},
                        {"ddqn", "Double DQN", {{"random", 0.589, 0.161}, {"mcts:10", 0.214, 0.161}}}}};
}

}  // namespace dbr::connect4
