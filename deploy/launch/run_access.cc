#include "deploy/launch/run_access.h"

#include <filesystem>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/run_folder.h"
#include "core/safetensors.h"
#include "core/status_macros.h"
#include "nn/product/blas_setup.h"
#include "proto/config/config_file.h"
#include "proto/rpc/address.h"

namespace dbr {

absl::StatusOr<std::shared_ptr<const PolicyNetworks>> OpenPolicy(const std::string& file_or_run) {
  std::error_code ignored;
  const bool run = std::filesystem::is_directory(file_or_run, ignored);
  const std::string path = run ? RunFolder{file_or_run}.latest_policy() : file_or_run;
  if (run && !std::filesystem::exists(path, ignored)) {
    return absl::NotFoundError(absl::StrCat("'", file_or_run,
                                            "' has no policy/latest.safetensors: expected a run folder ",
                                            "whose learner has pushed a policy, or a policy file"));
  }
  // Before the first product of whoever asks.
  RETURN_IF_ERROR(CheckBlasMemory(static_cast<int>(std::thread::hardware_concurrency())));
  ASSIGN_OR_RETURN(PolicySnapshot snapshot, LoadPolicy(path));
  absl::StatusOr<std::shared_ptr<const PolicyNetworks>> policy = PolicyNetworks::Create(std::move(snapshot));
  if (policy.ok()) return policy;
  return absl::Status(policy.status().code(), absl::StrCat(path, ": ", policy.status().message()));
}

absl::StatusOr<std::string> ReplayAddress(const std::string& address_or_run) {
  std::error_code ignored;
  if (std::filesystem::is_directory(address_or_run, ignored)) {
    const RunFolder folder{address_or_run};
    ASSIGN_OR_RETURN(const Config config, LoadConfig(folder.config()));
    return config.replay().address().empty() ? folder.replay_address() : config.replay().address();
  }
  if (std::filesystem::is_socket(address_or_run, ignored)) return absl::StrCat("unix:", address_or_run);
  if (absl::StrContains(address_or_run, ':')) {
    const absl::Status status = ParseClientAddress(address_or_run).status();
    if (!status.ok()) return absl::InvalidArgumentError(absl::StrCat("--replay: ", status.message()));
    return address_or_run;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--replay: expected unix:PATH, HOST:PORT or a run folder, found '", address_or_run, "'"));
}

}  // namespace dbr
