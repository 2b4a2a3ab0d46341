// What the learner asks of any actor-critic, answered from its networks. An algorithm derives from this, adds
// Update and UpdateFlops, and hides what it has more to say on.
#pragma once

#include <utility>
#include <vector>

#include "learner/algorithm.h"

namespace dbr {

// Networks: ActorCritic (learner/training/actor_critic.h) or what derives from it.
template <class Networks>
class ActorCriticAlgorithm {
 public:
  BatchNeeds needs() const { return networks_.needs(); }
  const std::vector<float>& advantages() const { return networks_.advantages; }
  const std::vector<UpdateMetric>& metrics() const { return metrics_; }
  void ExportPolicy(PolicySnapshot* snapshot) const { networks_.Export(snapshot); }
  void Save(TensorFile* file) const { networks_.Save(file); }
  absl::Status Load(const TensorFile& file) { return networks_.Load(file); }

 protected:
  // The names of the metrics, and what the networks are made from.
  template <class... Arguments>
  explicit ActorCriticAlgorithm(std::vector<UpdateMetric> metrics, const Arguments&... arguments)
      : networks_(arguments...), metrics_(std::move(metrics)) {}

  Networks networks_;
  std::vector<UpdateMetric> metrics_;
};

}  // namespace dbr
