// The interface of a learning algorithm. Each algorithm is one class in algorithms/, built from the parts in
// training/ and objectives/. It has no other base class.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/batch.h"
#include "core/policy_snapshot.h"
#include "core/safetensors.h"
#include "core/space.h"
#include "core/symmetry.h"
#include "proto/config.pb.h"

namespace dbr {

// The number of transitions that one update wants from D, D+ and D-.
struct BatchNeeds {
  int uniform = 0;
  int plus = 0;
  int minus = 0;
};

// The batches of one update. A part whose partition was empty has size 0.
struct UpdateBatches {
  const Batch& uniform;
  const Batch& plus;
  const Batch& minus;
};

// A named quantity of the newest update, for people to read. An algorithm never changes the order of its
// names.
struct UpdateMetric {
  const char* name;
  double value = 0;
};

// Values that a phase of the run sets from outside, in place of those that an algorithm learns or has in its
// config. Those that are not set have no effect.
struct UpdateControls {
  std::optional<double> multiplier;      // of the constraint
  std::optional<double> temperature;     // of the entropy
  std::optional<double> target_entropy;  // that the temperature aims at, in nats for each dimension
};

// What an algorithm is made from. `seed` is the random seed of its parameters and its noise.
struct AlgorithmSpec {
  std::string env;
  int observation_size = 0;
  ActionSpace actions;
  Symmetry symmetry;  // of the environment; empty where it has none
  std::vector<int> hidden_sizes;
  bool normalize_observations = false;
  bool critic_layer_norm = false;  // whether the critics normalise their hidden layers
  bool bfloat16 = false;           // whether matrix products take bfloat16 and sum in float32
  AlgorithmConfig config;
  std::uint64_t seed = 0;
};

// One learning algorithm with its networks and optimizers. The trainer owns it. One thread at a time may call
// it; an update may use a second thread inside (AlgorithmConfig.threads).
class Algorithm {
 public:
  virtual ~Algorithm() = default;

  virtual BatchNeeds needs() const = 0;

  // Makes one update. It allocates nothing once the batch sizes have settled. Returns Internal, naming the
  // quantity, where a loss or a parameter is no longer finite. The state is then worthless and training must
  // stop.
  virtual absl::Status Update(const UpdateBatches& batches) = 0;

  // Sets what holds in the updates from now on. An algorithm that has no such value takes no notice of it
  // (config_combinations.cc refuses a config that asks for it).
  virtual void SetControls(const UpdateControls&) {}

  // The advantage of each transition in the newest update's uniform batch [n].
  virtual absl::Span<const float> advantages() const = 0;
  // The metrics of the newest update.
  virtual absl::Span<const UpdateMetric> metrics() const = 0;

  // The useful floating-point operations of one update with full batches: its matrix products, each counted
  // once.
  virtual double UpdateFlops() const = 0;

  // Writes the networks that actors and evaluators need. The caller fills in the version and the number of
  // updates.
  virtual void ExportPolicy(PolicySnapshot* snapshot) const = 0;

  // Writes everything that a bit-for-bit continuation needs: parameters, targets, optimizer moments,
  // multipliers, the random generator and counters.
  virtual void Save(TensorFile* file) const = 0;
  // Reads what Save wrote. Returns DataLoss where a tensor or counter is missing and InvalidArgument where a
  // tensor has another size, and names it. The state is then unspecified.
  virtual absl::Status Load(const TensorFile& file) = 0;
};

// The name of the algorithm that a config sets: the member of its oneof ("dbr"). It is "" where the config
// sets none.
std::string AlgorithmName(const AlgorithmConfig& config);

}  // namespace dbr
