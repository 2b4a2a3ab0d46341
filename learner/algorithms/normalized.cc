#include "learner/algorithms/normalized.h"

#include <type_traits>
#include <utility>

#include "core/batch.h"
#include "core/columns.h"
#include "learner/training/policy_export.h"
#include "learner/training/tensor_state.h"

namespace dbr {
namespace {

constexpr float kLeastDeviation = 1e-3f;  // the least deviation to divide by

// The mean and variance of each feature over all columns seen, by the pairwise update of Chan, Golub and
// LeVeque (1983). They are in single precision, as checkpoints keep them, so that a resumed estimate
// continues bit for bit.
class FeatureStatistics {
 public:
  explicit FeatureStatistics(int features)
      : mean_(VectorX<float>::Zero(features)),
        variance_(VectorX<float>::Ones(features)),
        scale_(VectorX<float>::Ones(features)),
        batch_mean_(features) {}

  void Add(const MatrixX<float>& columns) {
    const auto n = static_cast<float>(columns.cols());
    batch_mean_ = columns.rowwise().mean();
    const float before = static_cast<float>(count_), share = n / (before + n);
    for (Eigen::Index i = 0; i < mean_.size(); ++i) {
      const float variance = (columns.row(i).array() - batch_mean_[i]).square().mean();
      const float difference = batch_mean_[i] - mean_[i];
      const float old = count_ == 0 ? 0.0f : variance_[i];
      variance_[i] = (1 - share) * old + share * variance + share * (1 - share) * difference * difference;
      mean_[i] += share * difference;
    }
    count_ += static_cast<std::uint64_t>(columns.cols());
    SetScale();
  }

  void Apply(const MatrixX<float>& columns, MatrixX<float>* normalized) const {
    *normalized = ((columns.colwise() - mean_).array().colwise() * scale_.array()).matrix();
  }

  const VectorX<float>& mean() const { return mean_; }
  const VectorX<float>& scale() const { return scale_; }

  void Save(TensorFile* file) const {
    PutTensor("observation.mean", mean_, file);
    PutTensor("observation.variance", variance_, file);
    PutCounter("observation.count", count_, file);
  }
  absl::Status Load(const TensorFile& file) {
    absl::Status status = GetTensor("observation.mean", file, &mean_);
    status.Update(GetTensor("observation.variance", file, &variance_));
    status.Update(GetCounter("observation.count", file, &count_));
    SetScale();
    return status;
  }

 private:
  void SetScale() { scale_ = variance_.cwiseSqrt().cwiseMax(kLeastDeviation).cwiseInverse(); }

  VectorX<float> mean_, variance_, scale_, batch_mean_;  // [features]
  std::uint64_t count_ = 0;
};

class NormalizedAlgorithm final : public Algorithm {
 public:
  NormalizedAlgorithm(int observation_size, std::unique_ptr<Algorithm> inner)
      : statistics_(observation_size), inner_(std::move(inner)) {}

  BatchNeeds needs() const override { return inner_->needs(); }
  absl::Status Update(const UpdateBatches& batches) override {
    statistics_.Add(batches.uniform.observations);
    Normalize(batches.uniform, &uniform_);
    Normalize(batches.plus, &plus_);
    Normalize(batches.minus, &minus_);
    return inner_->Update({uniform_, plus_, minus_});
  }
  void SetControls(const UpdateControls& controls) override { inner_->SetControls(controls); }
  absl::Span<const float> advantages() const override { return inner_->advantages(); }
  absl::Span<const UpdateMetric> metrics() const override { return inner_->metrics(); }
  double UpdateFlops() const override { return inner_->UpdateFlops(); }
  void ExportPolicy(PolicySnapshot* snapshot) const override {
    inner_->ExportPolicy(snapshot);
    VectorX<float> both(2 * statistics_.mean().size());
    both << statistics_.mean(), statistics_.scale();
    ExportNetwork(kObservationNormalizer, both, snapshot);
  }
  void Save(TensorFile* file) const override {
    inner_->Save(file);
    statistics_.Save(file);
  }
  absl::Status Load(const TensorFile& file) override {
    absl::Status status = inner_->Load(file);
    status.Update(statistics_.Load(file));
    return status;
  }

 private:
  void Normalize(const Batch& batch, Batch* normalized) const {
    const auto normalize = [this, &batch](const auto& from, auto& to) {
      if constexpr (std::is_same_v<decltype(to), MatrixX<float>&>) {
        const bool is_state = &from == &batch.observations || &from == &batch.next_observations;
        if (is_state && batch.size() > 0) return statistics_.Apply(from, &to);
      }
      to = from;
    };
    ForEachColumn(normalize, batch, *normalized);
    normalized->keys = batch.keys;
  }

  FeatureStatistics statistics_;
  std::unique_ptr<Algorithm> inner_;
  Batch uniform_, plus_, minus_;
};

}  // namespace

std::unique_ptr<Algorithm> Normalized(const AlgorithmSpec& spec, std::unique_ptr<Algorithm> inner) {
  return std::make_unique<NormalizedAlgorithm>(spec.observation_size, std::move(inner));
}

}  // namespace dbr
