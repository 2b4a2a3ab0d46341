// The methods of Algorithm that are the same for every actor-critic, answered from its networks. An algorithm
// derives from this class and adds Update and UpdateFlops. Where its answer differs, it hides the method with
// its own.
#pragma once

#include <utility>
#include <vector>

#include "learner/algorithm.h"

namespace dbr {

// The base of an actor-critic algorithm. `Networks` is ActorCritic (learner/training/actor_critic.h) or
// derives from it. One thread at a time.
template <class Networks>
class ActorCriticAlgorithm {
 public:
  BatchNeeds needs() const { return networks_.needs(); }
  // Of networks that have such values.
  void SetControls(const UpdateControls& controls) requires requires(Networks networks) { networks.controls; }
  { networks_.controls = controls; }
  const std::vector<float>& advantages() const { return networks_.advantages; }
  const std::vector<UpdateMetric>& metrics() const { return metrics_; }
  void ExportPolicy(PolicySnapshot* snapshot) const { networks_.Export(snapshot); }
  void Save(TensorFile* file) const { networks_.Save(file); }
  absl::Status Load(const TensorFile& file) { return networks_.Load(file); }

 protected:
  // `metrics` holds the names of the metrics in their order. `arguments` go to the constructor of the
  // networks.
  template <class... Arguments>
  explicit ActorCriticAlgorithm(std::vector<UpdateMetric> metrics, const Arguments&... arguments)
      : networks_(arguments...), metrics_(std::move(metrics)) {}

  Networks networks_;
  std::vector<UpdateMetric> metrics_;
};

}  // namespace dbr
