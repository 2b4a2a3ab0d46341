#include "learner/algorithms/mirrored.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/batch.h"
#include "core/check.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "core/symmetry.h"
#include "learner/training/tensor_state.h"

namespace dbr {
namespace {

constexpr std::uint64_t kStream = 0x6d6972726f72;  // keeps the draws apart from those of the algorithm
constexpr char kRng[] = "mirror.rng";

// Gives sample j of `image` the floats of sample j of `columns`, each at its new place.
void Place(const std::vector<int>& places, const MatrixX<float>& columns, Eigen::Index j,
           MatrixX<float>* image) {
  for (Eigen::Index i = 0; i < columns.rows(); ++i)
    (*image)(places[static_cast<std::size_t>(i)], j) = columns(i, j);
}

class MirroredAlgorithm final : public Algorithm {
 public:
  MirroredAlgorithm(const AlgorithmSpec& spec, std::unique_ptr<Algorithm> inner)
      : symmetry_(spec.symmetry),
        discrete_(spec.actions.discrete()),
        rng_(Rng(spec.seed).Fork(kStream)),
        inner_(std::move(inner)) {
    DBR_CHECK(CheckSymmetry(symmetry_, spec.observation_size, spec.actions.size).ok());
  }

  BatchNeeds needs() const override { return inner_->needs(); }
  absl::Status Update(const UpdateBatches& batches) override {
    Mirror(batches.uniform, &uniform_);
    Mirror(batches.plus, &plus_);
    Mirror(batches.minus, &minus_);
    return inner_->Update({uniform_, plus_, minus_});
  }
  void SetControls(const UpdateControls& controls) override { inner_->SetControls(controls); }
  absl::Span<const float> advantages() const override { return inner_->advantages(); }
  absl::Span<const UpdateMetric> metrics() const override { return inner_->metrics(); }
  double UpdateFlops() const override { return inner_->UpdateFlops(); }
  void ExportPolicy(PolicySnapshot* snapshot) const override { inner_->ExportPolicy(snapshot); }
  void Save(TensorFile* file) const override {
    inner_->Save(file);
    PutRng(kRng, rng_, file);
  }
  absl::Status Load(const TensorFile& file) override {
    RETURN_IF_ERROR(inner_->Load(file));
    const absl::Status status = GetRng(kRng, file, &rng_);
    if (status.ok()) return status;
    return absl::Status(status.code(),
                        absl::StrCat(status.message(), ": it was written without algorithm.mirror. ",
                                     "Set algorithm.mirror to false, or start a new run."));
  }

 private:
  void Mirror(const Batch& batch, Batch* mirrored) {
    *mirrored = batch;
    for (Eigen::Index j = 0; j < batch.size(); ++j) {
      if (rng_.Below(2) == 1) MirrorSample(batch, j, mirrored);
    }
  }

  // Replaces sample j of `mirrored` by the image of sample j of `batch`.
  void MirrorSample(const Batch& batch, Eigen::Index j, Batch* mirrored) const {
    Place(symmetry_.observation, batch.observations, j, &mirrored->observations);
    Place(symmetry_.observation, batch.next_observations, j, &mirrored->next_observations);
    Place(symmetry_.action, batch.masks, j, &mirrored->masks);
    Place(symmetry_.action, batch.next_masks, j, &mirrored->next_masks);
    if (discrete_) {
      const auto action = static_cast<std::size_t>(batch.actions(0, j));
      mirrored->actions(0, j) = static_cast<float>(symmetry_.action[action]);
    } else {
      Place(symmetry_.action, batch.actions, j, &mirrored->actions);
      Place(symmetry_.action, batch.next_actions, j, &mirrored->next_actions);
    }
  }

  const Symmetry symmetry_;
  const bool discrete_;  // whether an action is an index
  Rng rng_;
  std::unique_ptr<Algorithm> inner_;
  Batch uniform_, plus_, minus_;
};

}  // namespace

std::unique_ptr<Algorithm> Mirrored(const AlgorithmSpec& spec, std::unique_ptr<Algorithm> inner) {
  return std::make_unique<MirroredAlgorithm>(spec, std::move(inner));
}

absl::Status CheckMirror(const AlgorithmConfig& config, const EnvSpec& env) {
  if (!config.mirror()) return absl::OkStatus();
  if (env.symmetry.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("algorithm.mirror: expected false, for environment '",
                                                   env.name, "' has no symmetry, found true"));
  }
  const absl::Status fits = CheckSymmetry(env.symmetry, env.observation_size, env.actions.size);
  if (fits.ok()) return fits;
  return absl::InvalidArgumentError(
      absl::StrCat("algorithm.mirror: environment '", env.name, "': ", fits.message()));
}

}  // namespace dbr
