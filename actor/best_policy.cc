#include "actor/best_policy.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/policy_file.h"
#include "core/safetensors.h"
#include "core/status_macros.h"
#include "nn/policy_choice.h"

namespace dbr {
namespace {

constexpr char kMean[] = "evaluation.mean";
constexpr char kMeasure[] = "evaluation.measure";
constexpr char kPlayed[] = "evaluation.policy";

std::string Metadata(const TensorFile& file, const std::string& key) {
  const auto found = file.metadata.find(key);
  return found == file.metadata.end() ? "" : found->second;
}

}  // namespace

BestPolicy::BestPolicy(std::string path, std::string measure)
    : path_(std::move(path)), measure_(std::move(measure)) {
  std::error_code ignored;
  if (path_.empty() || !std::filesystem::exists(path_, ignored)) return;
  if (const absl::Status read = Read(); !read.ok()) {
    spdlog::warn("the best policy of before does not count, and the next one takes its place: {}",
                 std::string(read.message()));
    return;
  }
  spdlog::info("the best policy so far has {:.4g} ({})", mean_, measure_);
}

absl::Status BestPolicy::Read() {
  ASSIGN_OR_RETURN(const TensorFile file, LoadTensors(path_));
  const std::string found = Metadata(file, kMeasure);
  if (found != measure_) {
    return absl::FailedPreconditionError(absl::StrCat(path_, ": expected an evaluation by '", measure_, "', ",
                                                      found.empty() ? "found none" : "found one by '", found,
                                                      found.empty() ? "" : "'"));
  }
  double mean = 0;
  const std::string text = Metadata(file, kMean);
  if (!absl::SimpleAtod(text, &mean) || !std::isfinite(mean)) {
    return absl::DataLossError(
        absl::StrCat(path_, ": metadata '", kMean, "': expected a finite number, found '", text, "'"));
  }
  mean_ = mean;
  return absl::OkStatus();
}

void BestPolicy::Offer(double mean, PolicyChoice played, const PolicySnapshot& snapshot) {
  if (path_.empty() || !(mean > mean_)) return;
  if (const absl::Status written = Write(mean, played, snapshot); !written.ok()) {
    spdlog::error("the best policy so far is not kept: {}", std::string(written.message()));
    return;
  }
  mean_ = mean;
}

absl::Status BestPolicy::Write(double mean, PolicyChoice played, const PolicySnapshot& snapshot) const {
  ASSIGN_OR_RETURN(TensorFile file, PolicyTensors(snapshot));
  file.metadata[kMean] = absl::StrFormat("%.17g", mean);
  file.metadata[kMeasure] = measure_;
  file.metadata[kPlayed] = NameOf(played);
  std::error_code ignored;  // SaveTensors then reports the error
  // Not the folder of the run: where that has gone, it was moved, and a new one would split the run.
  std::filesystem::create_directory(std::filesystem::path(path_).parent_path(), ignored);
  return SaveTensors(file, path_);
}

}  // namespace dbr
