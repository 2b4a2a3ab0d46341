// Tests DBR's target y = r + discount * V'(s') in double against plain loops over the networks' outputs: the
// temperature's part, the weight of the smaller critic, and the value penalty.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "learner/algorithms/continuous_dbr.h"
#include "learner/algorithms/discrete_dbr.h"
#include "nn/normal_noise.h"
#include "nn/policy_networks.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

using Matrix = MatrixX<double>;
using Vector = VectorX<double>;

// The output of a network of a checkpoint.
Matrix Output(const TensorFile& state, const std::string& network, const MlpShape& shape, const Matrix& x) {
  const std::vector<float>& values = state.tensors.at(network);
  const Vector parameters =
      Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size()))
          .cast<double>();
  MlpActivations<double> activations;
  return MlpForward<double>(shape, parameters.data(), x, &activations);
}

double Mixed(double q1, double q2, double min_weight) {
  return min_weight * std::min(q1, q2) + (1 - min_weight) * std::max(q1, q2);
}

// The probabilities of the legal actions [actions], by a softmax.
Vector Softmax(const Vector& logits, const Vector& mask) {
  Vector p = mask.array() * (logits.array() - logits.maxCoeff()).exp();
  return p / p.sum();
}

// V'(s') without a penalty and KL(pi'(.|s') || beta+(.|s')) at each next state of a batch, by plain loops.
// `state` is that from before the update, and `beta_plus` that of after it.
struct NextState {
  double value = 0, divergence = 0;
};

NextState DiscreteNext(const AlgorithmSpec& spec, const TensorFile& state, const TensorFile& after,
                       const BasicBatch<double>& batch, Eigen::Index j, double tau) {
  const MlpShape shape = PolicyShape(PolicySpecOf(spec));
  const Matrix x = batch.next_observations.col(j);
  const Vector mask = batch.next_masks.col(j);
  const Vector p = Softmax(Output(state, "policy.target", shape, x), mask);
  const Vector beta = Softmax(Output(after, "beta_plus", shape, x), mask);
  const Matrix q1 = Output(state, "critic_1.target", shape, x);
  const Matrix q2 = Output(state, "critic_2.target", shape, x);
  NextState next;
  for (int a = 0; a < p.size(); ++a) {
    if (mask[a] == 0) continue;
    next.value += p[a] * Mixed(q1(a, 0), q2(a, 0), spec.config.dbr().target_min_weight());
    next.value -= tau * p[a] * std::log(p[a]);
    next.divergence += p[a] * std::log(p[a] / beta[a]);
  }
  return next;
}

// noise [dimensions x draws * n], as the update draws it.
NextState ContinuousNext(const AlgorithmSpec& spec, const TensorFile& state, const TensorFile& after,
                         const BasicBatch<double>& batch, Eigen::Index j, double tau, const Matrix& noise) {
  const Matrix x = batch.next_observations.col(j);
  const int dimensions = spec.actions.size;
  const MlpShape policy_shape = PolicyShape(PolicySpecOf(spec)),
                 critic_shape = CriticShape(PolicySpecOf(spec));
  const Matrix pi = Output(state, "policy.target", policy_shape, x);
  const Matrix beta = Output(after, "beta_plus", policy_shape, x);
  NextState next;
  next.value = -1e9;
  for (Eigen::Index k = j; k < noise.cols(); k += batch.size()) {
    Matrix input(x.rows() + dimensions, 1);
    input.topRows(x.rows()) = x;
    double log_prob = 0;
    for (int d = 0; d < dimensions; ++d) {
      const double log_std = pi(dimensions + d, 0), e = noise(d, k);
      const double a = std::tanh(pi(d, 0) + std::exp(log_std) * e);
      input(x.rows() + d, 0) = a;
      log_prob += -e * e / 2 - log_std - std::log(2 * M_PI) / 2 - std::log(1 - a * a);
    }
    const double q1 = Output(state, "critic_1.target", critic_shape, input)(0, 0);
    const double q2 = Output(state, "critic_2.target", critic_shape, input)(0, 0);
    next.value = std::max(next.value, Mixed(q1, q2, spec.config.dbr().target_min_weight()) - tau * log_prob);
  }
  for (int d = 0; d < dimensions; ++d) {
    const double s = pi(dimensions + d, 0), t = beta(dimensions + d, 0), miss = pi(d, 0) - beta(d, 0);
    next.divergence += t - s + (std::exp(2 * s) + miss * miss) / (2 * std::exp(2 * t)) - 0.5;
  }
  return next;
}

template <class Dbr>
class SoftTarget : public testing::Test {
 protected:
  static constexpr bool kDiscrete = std::is_same_v<Dbr, DiscreteDbr<double>>;

  SoftTarget() : spec_(SmallSpec(1, kDiscrete ? ActionKind::kDiscrete : ActionKind::kContinuous)) {
    spec_.config.set_learning_rate(0.02);
    spec_.config.set_reward_scale(2);
    spec_.config.set_target_tau(0.5);
    config()->set_target_min_weight(0.7);
    config()->set_first_temperature(0.4);
    config()->set_temperature_learning_rate(0.05);
  }

  DbrConfig* config() { return spec_.config.mutable_dbr(); }

  // Makes one update on n transitions from a state whose networks and targets differ. Returns the mean target
  // that it reports. Sets expected_ and penalty_ by the plain loops.
  double UpdateOn(int n) {
    Dbr dbr(spec_);
    Rng rng(23);
    for (int i = 0; i < 12; ++i) {
      const BasicBatch<double> batch = RandomBatch<double>(spec_, 16, rng);
      EXPECT_TRUE(dbr.Update(batch, batch, batch).ok());
    }
    TensorFile state, after;
    dbr.Save(&state);
    EXPECT_TRUE(dbr.Load(state).ok()) << "the parameters become those of the file, to the last bit";
    BasicBatch<double> batch = RandomBatch<double>(spec_, n, rng);
    batch.discounts[0] = 0.9;
    EXPECT_TRUE(dbr.Update(batch, batch, batch).ok());
    dbr.Save(&after);
    Expect(state, after, batch);
    for (const UpdateMetric& metric : dbr.metrics()) {
      if (std::string(metric.name) == "train/target_mean") return metric.value;
    }
    ADD_FAILURE() << "no target_mean";
    return 0;
  }

  void Expect(const TensorFile& state, const TensorFile& after, const BasicBatch<double>& batch) {
    const bool soft = config()->first_temperature() > 0;
    const double tau = soft ? std::exp(static_cast<double>(state.tensors.at("log_temperature")[0])) : 0;
    const double alpha = std::exp(static_cast<double>(state.tensors.at("log_alpha")[0]));
    Matrix noise;
    if constexpr (!kDiscrete) {
      Rng rng(0);
      EXPECT_TRUE(GetRng("dbr.rng", state, &rng).ok());
      FillNormal(rng, spec_.actions.size, config()->target_samples() * batch.size(), &noise);
    }
    std::vector<NextState> nexts;
    double size = 0;
    for (Eigen::Index j = 0; j < batch.size(); ++j) {
      if constexpr (kDiscrete) {
        nexts.push_back(DiscreteNext(spec_, state, after, batch, j, tau));
      } else {
        nexts.push_back(ContinuousNext(spec_, state, after, batch, j, tau, noise));
      }
      size += std::abs(nexts.back().value) / static_cast<double>(batch.size());
    }
    const double unit = config()->normalize_q() ? size : 1;
    expected_ = penalty_ = 0;
    for (Eigen::Index j = 0; j < batch.size(); ++j) {
      const NextState& next = nexts[static_cast<std::size_t>(j)];
      const double penalty = config()->value_penalty() ? alpha * unit * next.divergence : 0;
      penalty_ += batch.discounts[j] * penalty / static_cast<double>(batch.size());
      expected_ +=
          spec_.config.reward_scale() * batch.rewards[j] + batch.discounts[j] * (next.value - penalty);
    }
    expected_ /= static_cast<double>(batch.size());
  }

  AlgorithmSpec spec_;
  double expected_ = 0, penalty_ = 0;  // the penalty's part of the expected mean
};

using Both = testing::Types<DiscreteDbr<double>, ContinuousDbr<double>>;
TYPED_TEST_SUITE(SoftTarget, Both);

TYPED_TEST(SoftTarget, HasTheTemperaturesPart) {
  for (const int n : {1, 2, 7}) {
    const double found = this->UpdateOn(n);
    EXPECT_NEAR(found, this->expected_, 1e-10) << n;
  }
}

TYPED_TEST(SoftTarget, OfOneDrawIsSacs) {
  this->config()->set_target_samples(1);
  const double found = this->UpdateOn(7);
  EXPECT_NEAR(found, this->expected_, 1e-10);
}

TYPED_TEST(SoftTarget, WithoutATemperatureIsThePapers) {
  this->config()->clear_first_temperature();
  this->config()->set_entropy_weight(0.3);
  const double found = this->UpdateOn(7);
  EXPECT_NEAR(found, this->expected_, 1e-10) << "entropy_weight is the policy's alone";
}

// The states of beta+ that the loops read are floats, so that the tolerance is wider here.
TYPED_TEST(SoftTarget, HasTheValuePenaltyInUnitsOfTheCriticsValues) {
  this->config()->set_value_penalty(true);
  this->config()->set_first_multiplier(3);
  for (const bool normalize : {false, true}) {
    this->config()->set_normalize_q(normalize);
    for (const int n : {1, 7}) {
      const double found = this->UpdateOn(n);
      EXPECT_NEAR(found, this->expected_, 1e-6) << normalize << " " << n;
      EXPECT_GT(this->penalty_, 1e-4) << "there is a penalty to see";
    }
  }
}

}  // namespace
}  // namespace dbr
