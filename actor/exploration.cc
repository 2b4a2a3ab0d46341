#include "actor/exploration.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace dbr {
namespace {

// Returns the index of a uniformly drawn legal action, or -1 where none is legal.
int DrawLegal(const MatrixX<float>& masks, int column, Rng& rng) {
  int legal = 0;
  for (int k = 0; k < masks.rows(); ++k) legal += masks(k, column) > 0;
  if (legal == 0) return -1;
  int remaining = static_cast<int>(rng.Below(legal));
  int k = 0;
  while (masks(k, column) <= 0 || remaining-- > 0) ++k;
  return k;
}

// Returns epsilon after `steps` steps of all processes together.
double EpsilonAt(const ExplorationOptions& options, std::uint64_t steps) {
  if (options.epsilon_decay_steps == 0) return options.epsilon;
  const double done =
      std::min(1.0, static_cast<double>(steps) / static_cast<double>(options.epsilon_decay_steps));
  return (1 - done) * options.epsilon + done * options.final_epsilon;
}

}  // namespace

ExplorationOptions ExplorationOptions::Of(const ActorConfig& config) {
  return {.epsilon = config.epsilon(),
          .epsilon_ladder = config.epsilon_ladder(),
          .epsilon_decay_steps = config.epsilon_decay_steps(),
          .final_epsilon = config.final_epsilon(),
          .action_noise = config.action_noise()};
}

absl::Status CheckExploration(const EnvSpec& env, const ActorConfig& config) {
  if (config.action_noise() == 0 || !env.actions.discrete()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("actor.action_noise: expected 0 for the discrete actions of environment '", env.name,
                   "', found ", config.action_noise(), ". Use actor.epsilon there."));
}

Exploration::Exploration(const ActionSpace& actions, const ExplorationOptions& options, int n)
    : space_(actions), options_(options), shares_(n) {
  SetShares();
}

void Exploration::SetShares() {
  const double epsilon =
      EpsilonAt(options_, options_.first_step + static_cast<std::uint64_t>(options_.processes) * steps_);
  const int n = static_cast<int>(shares_.size());
  for (int i = 0; i < n; ++i) {
    const double rung = n > 1 ? static_cast<double>(i) / (n - 1) : 0.0;
    shares_[i] = std::pow(epsilon, 1 + options_.epsilon_ladder * rung);
  }
}

int Exploration::Apply(const MatrixX<float>& masks, Rng& rng, MatrixX<float>* actions) {
  int replaced = 0;
  for (int i = 0; i < static_cast<int>(shares_.size()); ++i) {
    if (shares_[i] <= 0 || rng.Uniform() >= shares_[i]) {
      AddNoise(i, rng, actions);
      continue;
    }
    ++replaced;
    if (space_.discrete()) {
      (*actions)(0, i) = static_cast<float>(DrawLegal(masks, i, rng));
    } else {
      for (int k = 0; k < space_.size; ++k) (*actions)(k, i) = static_cast<float>(2 * rng.Uniform() - 1);
    }
  }
  steps_ += shares_.size();
  if (options_.epsilon_decay_steps > 0) SetShares();
  return replaced;
}

void Exploration::AddNoise(int i, Rng& rng, MatrixX<float>* actions) const {
  if (options_.action_noise == 0) return;
  for (int k = 0; k < space_.size; ++k) {
    const auto noise = static_cast<float>(options_.action_noise * rng.Normal());
    (*actions)(k, i) = std::clamp((*actions)(k, i) + noise, -1.0f, 1.0f);
  }
}

}  // namespace dbr
