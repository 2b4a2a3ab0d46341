// Small MDPs with explicit tables, to compare the algorithms with the paper's theory (its section "From ARM
// and BEAR to DBR"). Plain values and pure functions in double. Policies are tables [actions x states].
#pragma once

#include "core/batch.h"
#include "core/rng.h"

namespace dbr::tabular {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

struct Mdp {
  int states = 0, actions = 0;
  Matrix next;   // [states x actions * states] P(.|s, a) in column s * actions + a
  Vector start;  // [states] rho_0

  Matrix::ConstColXpr NextOf(int state, int action) const {
    return next.col(Eigen::Index{state} * actions + action);
  }
};

// Makes a random MDP. Every (s, a) leads to at most `successors` states, drawn at random with random weights.
// It starts in one or two states.
Mdp RandomMdp(int states, int actions, int successors, Rng& rng);

// Returns the softmax, over each state's actions, of `sharpness` times normal logits.
Matrix RandomPolicy(int states, int actions, double sharpness, Rng& rng);

// Returns a table [actions x states]: 1 where Pi_eps lets a policy act, beta+(a|s) >= max(eps, beta-(a|s)),
// else 0.
Matrix SupportOf(const Matrix& plus, const Matrix& minus, double epsilon);
// Returns false where a state has no such action. Pi_eps is then empty.
bool SupportsEveryState(const Matrix& support);

// Returns P^pi [states x states]. Column s is the distribution after s.
Matrix Transitions(const Mdp& mdp, const Matrix& policy);

// The two readings of "marginal state distribution" over p_k = rho_0 (P^pi)^k. Both sum to 1.
enum class Marginal {
  kDiscounted,  // (1 - gamma) sum over k >= 0 of gamma^k p_k
  kProof,       // (1 - gamma)^2 sum over k >= 1 of k gamma^(k-1) p_k: the weights of the paper's proof and C
};
Vector StateMarginal(const Mdp& mdp, const Matrix& policy, double discount, Marginal marginal);

// Computes the greatest probability of each state after exactly k steps from rho_0, over all sequences of
// policies with the given support. It uses dynamic programming backwards from each state, one step a call.
// (Deterministic policies reach the maximum over sequences.)
class GreatestReach {
 public:
  GreatestReach(const Mdp& mdp, const Matrix& support);
  // Returns the probabilities [states] for the next k, which starts at 1.
  Vector Next();

 private:
  const Mdp& mdp_;
  const Matrix support_;
  Matrix to_go_;  // [states from x states to]
};

// Returns the least mu(s) among the states that policies with the support reach in one step or more.
double LeastReached(const Mdp& mdp, const Matrix& support, const Vector& mu);

// Returns C = (1 - gamma)^2 sum over k >= 1 of k gamma^(k-1) c(k), where c(k) is the greatest ratio, over
// states, of the probability after k steps to mu. The first function takes all sequences of policies with the
// support, the second one policy. Infinite where a state with mu = 0 is reached. The series is summed until
// its rest is below 1e-9.
double Concentrability(const Mdp& mdp, const Matrix& support, const Vector& mu, double discount);
double ConcentrabilityOf(const Mdp& mdp, const Matrix& policy, const Vector& mu, double discount);

}  // namespace dbr::tabular
