// Tests algorithms that see images under the symmetry of their environment.
#include "learner/algorithms/mirrored.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "core/rng.h"
#include "learner/algorithms/registry.h"
#include "tests/learner/algorithms/batches.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// Keeps the batches of its newest update.
class Recorder final : public Algorithm {
 public:
  explicit Recorder(Batch seen[3]) : seen_(seen) {}

  BatchNeeds needs() const override { return {1, 2, 3}; }
  absl::Status Update(const UpdateBatches& batches) override {
    seen_[0] = batches.uniform;
    seen_[1] = batches.plus;
    seen_[2] = batches.minus;
    return absl::OkStatus();
  }
  absl::Span<const float> advantages() const override { return {}; }
  absl::Span<const UpdateMetric> metrics() const override { return {}; }
  double UpdateFlops() const override { return 7; }
  void ExportPolicy(PolicySnapshot*) const override {}
  void Save(TensorFile*) const override {}
  absl::Status Load(const TensorFile&) override { return absl::OkStatus(); }

 private:
  Batch* seen_;  // [3]
};

AlgorithmSpec MirroredSpec(ActionKind actions = ActionKind::kDiscrete, std::uint64_t seed = 1) {
  AlgorithmSpec spec = SmallSpec(seed, actions);
  spec.symmetry = SmallSymmetry(actions);
  spec.config.set_mirror(true);
  spec.config.mutable_dbr()->set_advantage(DbrConfig::SIL);  // so that batches have returns
  return spec;
}

// The image of every transition of a batch, worked out by hand from what SmallSymmetry says.
Batch ImageOf(const Batch& batch, ActionKind actions) {
  Batch image = batch;
  for (MatrixX<float>* columns : {&image.observations, &image.next_observations}) {
    columns->row(0).swap(columns->row(1));
    columns->row(3).swap(columns->row(4));
  }
  if (actions == ActionKind::kContinuous) {
    image.actions.row(0).swap(image.actions.row(1));
    return image;
  }
  image.masks.row(0).swap(image.masks.row(1));
  image.next_masks.row(0).swap(image.next_masks.row(1));
  for (float& action : image.actions.reshaped()) action = action == 0 ? 1 : action == 1 ? 0 : 2;
  return image;
}

bool SampleIs(const Batch& a, const Batch& b, Eigen::Index j) {
  return a.observations.col(j) == b.observations.col(j) &&
         a.next_observations.col(j) == b.next_observations.col(j) && a.masks.col(j) == b.masks.col(j) &&
         a.next_masks.col(j) == b.next_masks.col(j) && a.actions.col(j) == b.actions.col(j);
}

class MirroredTest : public testing::TestWithParam<ActionKind> {};

TEST_P(MirroredTest, HalfOfTheTransitionsOfEachBatchAreImagesAndTheOthersStay) {
  constexpr int kSamples = 4000;
  const AlgorithmSpec spec = MirroredSpec(GetParam());
  Batch seen[3], drawn[3];
  const auto algorithm = Mirrored(spec, std::make_unique<Recorder>(seen));
  Rng rng(5);
  for (Batch& batch : drawn) {
    batch = RandomBatch<float>(spec, kSamples, rng);
    if (!spec.actions.discrete()) continue;
    batch.masks.row(0).setZero();  // so that the images of the masks differ from them
    batch.next_masks.row(1).setZero();
  }
  ASSERT_TRUE(algorithm->Update({drawn[0], drawn[1], drawn[2]}).ok());
  for (int part = 0; part < 3; ++part) {
    const Batch image = ImageOf(drawn[part], GetParam());
    int images = 0;
    for (Eigen::Index j = 0; j < kSamples; ++j) {
      const bool replaced = SampleIs(seen[part], image, j);
      ASSERT_NE(replaced, SampleIs(seen[part], drawn[part], j)) << part << ": sample " << j;
      images += replaced ? 1 : 0;
    }
    EXPECT_NEAR(images, kSamples / 2, 160) << part;  // five standard deviations
    EXPECT_EQ(seen[part].rewards, drawn[part].rewards);
    EXPECT_EQ(seen[part].discounts, drawn[part].discounts);
    EXPECT_EQ(seen[part].returns, drawn[part].returns);
    EXPECT_EQ(seen[part].returns.size(), kSamples);
    EXPECT_EQ(seen[part].keys, drawn[part].keys);
  }
  EXPECT_EQ(algorithm->needs().minus, 3);
  EXPECT_EQ(algorithm->UpdateFlops(), 7);
}

INSTANTIATE_TEST_SUITE_P(Actions, MirroredTest,
                         testing::Values(ActionKind::kDiscrete, ActionKind::kContinuous),
                         [](const auto& info) {
                           return info.param == ActionKind::kDiscrete ? "Discrete" : "Continuous";
                         });

TEST(Mirrored, EachUpdateDrawsAnewAndAResumeDrawsTheSame) {
  const AlgorithmSpec spec = MirroredSpec();
  Batch first[3], second[3], resumed_seen[3];
  const auto algorithm = Mirrored(spec, std::make_unique<Recorder>(first));
  Rng rng(5);
  const Batch batch = RandomBatch<float>(spec, 64, rng), empty;
  ASSERT_TRUE(algorithm->Update({batch, batch, empty}).ok());
  EXPECT_NE(first[0].observations, first[1].observations);
  EXPECT_EQ(first[2].size(), 0);
  TensorFile saved;
  algorithm->Save(&saved);
  second[0] = first[0];
  ASSERT_TRUE(algorithm->Update({batch, batch, empty}).ok());
  EXPECT_NE(first[0].observations, second[0].observations);

  const auto resumed =
      Mirrored(MirroredSpec(ActionKind::kDiscrete, 77), std::make_unique<Recorder>(resumed_seen));
  ASSERT_TRUE(resumed->Load(saved).ok());
  ASSERT_TRUE(resumed->Update({batch, batch, empty}).ok());
  for (int part = 0; part < 2; ++part) {
    EXPECT_EQ(resumed_seen[part].observations, first[part].observations);
    EXPECT_EQ(resumed_seen[part].actions, first[part].actions);
  }
}

TEST(Mirrored, ACheckpointWithoutImagesIsRefusedWithWhatToDo) {
  AlgorithmSpec spec = MirroredSpec();
  spec.config.set_mirror(false);
  TensorFile before;
  MakeAlgorithm(spec).value()->Save(&before);
  const absl::Status status = MakeAlgorithm(MirroredSpec()).value()->Load(before);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("'mirror.rng.0'"), HasSubstr("Set algorithm.mirror to false")));
}

TEST(Mirrored, TheNormalizerSeesTheImages) {
  AlgorithmSpec spec = MirroredSpec();
  spec.normalize_observations = true;
  const auto algorithm = MakeAlgorithm(spec).value();
  Rng rng(3);
  Batch batch = RandomBatch<float>(spec, 1000, rng);
  batch.observations.row(0).setConstant(1);
  batch.observations.row(1).setConstant(-1);
  ASSERT_TRUE(algorithm->Update({batch, batch, batch}).ok());
  PolicySnapshot snapshot;
  algorithm->ExportPolicy(&snapshot);
  EXPECT_NEAR((*snapshot.Find(kObservationNormalizer))[0], 0, 0.2);  // without images 1
}

TEST(Mirrored, AnEnvironmentWithoutAFittingSymmetryIsRefusedByName) {
  AlgorithmSpec spec = MirroredSpec();
  spec.env = "hopper";
  spec.symmetry.action.pop_back();
  EXPECT_THAT(std::string(MakeAlgorithm(spec).status().message()),
              AllOf(HasSubstr("algorithm.mirror: environment 'hopper'"), HasSubstr("symmetry.action")));
  spec.symmetry = {};
  const absl::Status status = MakeAlgorithm(spec).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(),
            "algorithm.mirror: expected false, for environment 'hopper' has no symmetry, found true");
  spec.config.set_mirror(false);
  EXPECT_TRUE(MakeAlgorithm(spec).ok());
}

}  // namespace
}  // namespace dbr
