// Puts an algorithm's state into a checkpoint and reads it back.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/batch.h"
#include "core/rng.h"
#include "core/safetensors.h"

namespace dbr {

// Stores `values` as a tensor in single precision.
template <class Scalar>
void PutTensor(const std::string& name, const VectorX<Scalar>& values, TensorFile* file) {
  std::vector<float>& out = file->tensors[name];
  out.resize(static_cast<std::size_t>(values.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i)
    out[static_cast<std::size_t>(i)] = static_cast<float>(values[i]);
}

// Reads a tensor into `values`, which must have the expected size. Returns DataLoss where the tensor is
// missing and InvalidArgument where its size differs.
template <class Scalar>
absl::Status GetTensor(const std::string& name, const TensorFile& file, VectorX<Scalar>* values) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) {
    return absl::DataLossError(absl::StrCat("the checkpoint has no tensor '", name, "'"));
  }
  if (static_cast<Eigen::Index>(found->second.size()) != values->size()) {
    return absl::InvalidArgumentError(absl::StrCat("tensor '", name, "': expected ", values->size(),
                                                   " values, found ", found->second.size(),
                                                   ". The checkpoint is of other network sizes."));
  }
  for (Eigen::Index i = 0; i < values->size(); ++i) (*values)[i] = found->second[static_cast<std::size_t>(i)];
  return absl::OkStatus();
}

inline void PutCounter(const std::string& name, std::uint64_t value, TensorFile* file) {
  file->metadata[name] = absl::StrCat(value);
}

// Returns DataLoss where the counter is missing or is not a number.
inline absl::Status GetCounter(const std::string& name, const TensorFile& file, std::uint64_t* value) {
  const auto found = file.metadata.find(name);
  if (found == file.metadata.end() || !absl::SimpleAtoi(found->second, value)) {
    return absl::DataLossError(absl::StrCat("the checkpoint has no counter '", name, "'"));
  }
  return absl::OkStatus();
}

// Stores the state of a random generator as four counters.
inline void PutRng(const std::string& name, const Rng& rng, TensorFile* file) {
  for (std::size_t i = 0; i < rng.state().size(); ++i) {
    PutCounter(absl::StrCat(name, ".", i), rng.state()[i], file);
  }
}
// Reads it back. Returns the errors of GetCounter.
inline absl::Status GetRng(const std::string& name, const TensorFile& file, Rng* rng) {
  Rng::State state;
  absl::Status status;
  for (std::size_t i = 0; i < state.size(); ++i) {
    status.Update(GetCounter(absl::StrCat(name, ".", i), file, &state[i]));
  }
  rng->set_state(state);
  return status;
}

}  // namespace dbr
