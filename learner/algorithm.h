// The interface of a learning algorithm. Each has a file in algorithms/, is composed of what training/ and
// objectives/ hold, and has no other base class.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/batch.h"
#include "core/policy_snapshot.h"
#include "core/safetensors.h"
#include "core/space.h"
#include "proto/config.pb.h"

namespace dbr {

// How many transitions an update wants from D, D+ and D-.
struct BatchNeeds {
  int uniform = 0;
  int plus = 0;
  int minus = 0;
};

// What an update is given. A part whose partition was empty has size 0.
struct UpdateBatches {
  const Batch& uniform;
  const Batch& plus;
  const Batch& minus;
};

// A named quantity of the newest update, for people; the order of names never changes in an algorithm's life.
struct UpdateMetric {
  const char* name;
  double value = 0;
};

// What an algorithm is made for.
struct AlgorithmSpec {
  std::string env;
  int observation_size = 0;
  ActionSpace actions;
  std::vector<int> hidden_sizes;
  bool normalize_observations = false;
  AlgorithmConfig config;
  std::uint64_t seed = 0;
};

// One thread at a time.
class Algorithm {
 public:
  virtual ~Algorithm() = default;

  virtual BatchNeeds needs() const = 0;

  // One update. Allocates nothing once batch sizes have settled. Internal, naming the quantity, where a loss
  // or a parameter is no longer finite: the state is then worthless and training must stop.
  virtual absl::Status Update(const UpdateBatches& batches) = 0;

  // Of the newest update: an advantage for each transition of its uniform batch, and metrics.
  virtual absl::Span<const float> advantages() const = 0;
  virtual absl::Span<const UpdateMetric> metrics() const = 0;

  // Useful floating-point operations of one update with full batches: its matrix products, each counted once.
  virtual double UpdateFlops() const = 0;

  // The networks that actors and evaluators need; version and updates are the caller's to fill.
  virtual void ExportPolicy(PolicySnapshot* snapshot) const = 0;

  // Everything that continuing bit for bit needs: parameters, targets, optimizer moments, multipliers,
  // counters.
  virtual void Save(TensorFile* file) const = 0;
  // DataLoss or InvalidArgument, naming the tensor, where one is missing or of another size; the state is
  // then unspecified.
  virtual absl::Status Load(const TensorFile& file) = 0;
};

// Name of the algorithm that a config sets, as the member of its oneof ("dbr"); "" where it sets none.
std::string AlgorithmName(const AlgorithmConfig& config);

}  // namespace dbr
