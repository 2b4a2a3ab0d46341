// Puts an algorithm in single precision behind the Algorithm interface. The algorithms are class templates,
// so that their tests can run them in double precision.
#pragma once

#include "learner/algorithm.h"
#include "nn/flush_denormals.h"

namespace dbr {

// Owns the algorithm `Core<float>`. One thread at a time.
template <template <class> class Core>
class AlgorithmAdapter final : public Algorithm {
 public:
  explicit AlgorithmAdapter(const AlgorithmSpec& spec) : core_(spec) {}

  BatchNeeds needs() const override { return core_.needs(); }
  absl::Status Update(const UpdateBatches& batches) override {
    const FlushDenormals flush;
    return core_.Update(batches.uniform, batches.plus, batches.minus);
  }
  void SetControls(const UpdateControls& controls) override {
    if constexpr (requires { core_.SetControls(controls); }) core_.SetControls(controls);
  }
  absl::Span<const float> advantages() const override { return core_.advantages(); }
  absl::Span<const UpdateMetric> metrics() const override { return core_.metrics(); }
  double UpdateFlops() const override { return core_.UpdateFlops(); }
  void ExportPolicy(PolicySnapshot* snapshot) const override { core_.ExportPolicy(snapshot); }
  void Save(TensorFile* file) const override { core_.Save(file); }
  absl::Status Load(const TensorFile& file) override { return core_.Load(file); }

 private:
  Core<float> core_;
};

}  // namespace dbr
