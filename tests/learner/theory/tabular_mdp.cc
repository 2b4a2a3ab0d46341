#include "tests/learner/theory/tabular_mdp.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dbr::tabular {
namespace {

double Exponential(Rng& rng) {
  return -std::log(1 - rng.Uniform());
}

// Returns the greatest p(s) / mu(s) among the states with p(s) > 0.
double GreatestRatio(const Vector& p, const Vector& mu) {
  double greatest = 0;
  for (Eigen::Index s = 0; s < p.size(); ++s) {
    if (p[s] <= 0) continue;
    greatest = std::max(greatest, mu[s] > 0 ? p[s] / mu[s] : std::numeric_limits<double>::infinity());
  }
  return greatest;
}

// Sums the series of C over next_probabilities(), which returns each state's probability after 1, 2, ...
// steps.
template <class Next>
double SumSeries(const Vector& mu, double discount, const Next& next_probabilities) {
  constexpr double kRest = 1e-9;
  const double least = (mu.array() > 0).select(mu.array(), 1).minCoeff();  // no ratio is above 1 / least
  double sum = 0, power = 1;
  for (int k = 1;; ++k) {
    const double ratio = GreatestRatio(next_probabilities(), mu);
    if (std::isinf(ratio)) return ratio;
    sum += k * power * ratio;
    power *= discount;
    // The weights of the remaining terms add up to gamma^k (1 + k (1 - gamma)).
    if (power * (1 + k * (1 - discount)) < kRest * least) return (1 - discount) * (1 - discount) * sum;
  }
}

}  // namespace

Mdp RandomMdp(int states, int actions, int successors, Rng& rng) {
  const auto any_state = [&] {
    return static_cast<Eigen::Index>(rng.Below(static_cast<std::uint32_t>(states)));
  };
  Mdp mdp{.states = states,
          .actions = actions,
          .next = Matrix::Zero(states, Eigen::Index{states} * actions),
          .start = Vector::Zero(states)};
  for (Eigen::Index column = 0; column < mdp.next.cols(); ++column) {
    for (int i = 0; i < successors; ++i) mdp.next(any_state(), column) += Exponential(rng);
    mdp.next.col(column) /= mdp.next.col(column).sum();
  }
  for (int i = 0; i < 2; ++i) mdp.start[any_state()] += 0.5;
  return mdp;
}

Matrix RandomPolicy(int states, int actions, double sharpness, Rng& rng) {
  Matrix policy = Matrix::NullaryExpr(actions, states, [&] { return std::exp(sharpness * rng.Normal()); });
  for (int s = 0; s < states; ++s) policy.col(s) /= policy.col(s).sum();
  return policy;
}

Matrix SupportOf(const Matrix& plus, const Matrix& minus, double epsilon) {
  return (plus.array() >= minus.array().max(epsilon)).cast<double>();
}

bool SupportsEveryState(const Matrix& support) {
  return support.colwise().maxCoeff().minCoeff() > 0;
}

Matrix Transitions(const Mdp& mdp, const Matrix& policy) {
  Matrix transitions = Matrix::Zero(mdp.states, mdp.states);
  for (int s = 0; s < mdp.states; ++s) {
    for (int a = 0; a < mdp.actions; ++a) transitions.col(s) += policy(a, s) * mdp.NextOf(s, a);
  }
  return transitions;
}

Vector StateMarginal(const Mdp& mdp, const Matrix& policy, double discount, Marginal marginal) {
  const Matrix transitions = Transitions(mdp, policy);
  const Matrix system = Matrix::Identity(mdp.states, mdp.states) - discount * transitions;
  const Eigen::PartialPivLU<Matrix> solver(system);
  const Vector visits = (1 - discount) * solver.solve(mdp.start);
  if (marginal == Marginal::kDiscounted) return visits;
  const Vector later = transitions * visits;
  return (1 - discount) * solver.solve(later);
}

GreatestReach::GreatestReach(const Mdp& mdp, const Matrix& support)
    : mdp_(mdp), support_(support), to_go_(Matrix::Identity(mdp.states, mdp.states)) {}

Vector GreatestReach::Next() {
  Matrix greatest = Matrix::Zero(mdp_.states, mdp_.states);
  for (int s = 0; s < mdp_.states; ++s) {
    for (int a = 0; a < mdp_.actions; ++a) {
      if (support_(a, s) <= 0) continue;
      greatest.row(s) = greatest.row(s).cwiseMax(mdp_.NextOf(s, a).transpose().lazyProduct(to_go_));
    }
  }
  to_go_ = greatest;
  return to_go_.transpose().lazyProduct(mdp_.start);
}

double LeastReached(const Mdp& mdp, const Matrix& support, const Vector& mu) {
  GreatestReach reach(mdp, support);
  double least = std::numeric_limits<double>::infinity();
  // A state that can be reached is reached within as many steps as there are states.
  for (int k = 1; k <= mdp.states; ++k) {
    const Vector greatest = reach.Next();
    for (int s = 0; s < mdp.states; ++s) {
      if (greatest[s] > 0) least = std::min(least, mu[s]);
    }
  }
  return least;
}

double Concentrability(const Mdp& mdp, const Matrix& support, const Vector& mu, double discount) {
  GreatestReach reach(mdp, support);
  return SumSeries(mu, discount, [&] { return reach.Next(); });
}

double ConcentrabilityOf(const Mdp& mdp, const Matrix& policy, const Vector& mu, double discount) {
  const Matrix transitions = Transitions(mdp, policy);
  Vector probabilities = mdp.start;
  return SumSeries(mu, discount, [&] {
    probabilities = transitions.lazyProduct(probabilities).eval();
    return probabilities;
  });
}

}  // namespace dbr::tabular
