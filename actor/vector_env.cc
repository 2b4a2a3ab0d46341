#include "actor/vector_env.h"

#include <utility>

#include "core/check.h"
#include "core/status_macros.h"
#include "envs/registry/registry.h"

namespace dbr {

absl::StatusOr<std::unique_ptr<VectorEnv>> VectorEnv::Create(const EnvOptions& options, int count) {
  DBR_CHECK(count > 0);
  std::vector<std::unique_ptr<Env>> envs;
  envs.reserve(count);
  for (int i = 0; i < count; ++i) {
    ASSIGN_OR_RETURN(std::unique_ptr<Env> env, MakeEnv(options));
    envs.push_back(std::move(env));
  }
  return std::make_unique<VectorEnv>(std::move(envs));
}

VectorEnv::VectorEnv(std::vector<std::unique_ptr<Env>> envs)
    : envs_(std::move(envs)), results_(envs_.size()) {
  DBR_CHECK(!envs_.empty());
  for (const auto& env : envs_) DBR_CHECK(env->spec() == spec());
  for (MatrixX<float>* matrix : {&observations_, &next_observations_})
    matrix->setZero(spec().observation_size, size());
  for (MatrixX<float>* matrix : {&masks_, &next_masks_}) matrix->setZero(spec().actions.mask_width(), size());
}

void VectorEnv::Reset(int i, std::uint64_t seed) {
  envs_[i]->Reset(seed, MutableColumn(observations_, i), MutableColumn(masks_, i));
}

const StepResult& VectorEnv::Step(int i, const MatrixX<float>& actions) {
  results_[i] =
      envs_[i]->Step(Column(actions, i), MutableColumn(next_observations_, i), MutableColumn(next_masks_, i));
  return results_[i];
}

void VectorEnv::Advance() {
  observations_.swap(next_observations_);
  masks_.swap(next_masks_);
}

}  // namespace dbr
