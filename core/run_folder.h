// The files of a run, by their places in its folder.
#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace dbr {

// Gives paths; touches no file. Plain values.
struct RunFolder {
  std::string root;  // of the run

  // The effective config, with its defaults filled in.
  std::string config() const { return absl::StrCat(root, "/config.textproto"); }
  std::string summary() const { return absl::StrCat(root, "/summary.json"); }
  std::string metrics() const { return absl::StrCat(root, "/metrics.jsonl"); }
  std::string checkpoints() const { return absl::StrCat(root, "/checkpoints"); }
  std::string policies() const { return absl::StrCat(root, "/policy"); }
  std::string latest_policy() const { return absl::StrCat(root, "/policy/latest.safetensors"); }
  // The policy with the best evaluation.
  std::string best_policy() const { return absl::StrCat(root, "/policy/best.safetensors"); }
  // The policy after `updates` updates (LearnerConfig.keep_policy_every).
  std::string kept_policy(std::uint64_t updates) const {
    return absl::StrCat(root, "/policy/", updates, ".safetensors");
  }
  std::string logs() const { return absl::StrCat(root, "/logs"); }
  std::string log(absl::string_view process) const { return absl::StrCat(root, "/logs/", process, ".log"); }
  std::string replay_store() const { return absl::StrCat(root, "/replay.store"); }
  std::string replay_address() const { return absl::StrCat("unix:", root, "/replay.sock"); }
  std::string learner_address() const { return absl::StrCat("unix:", root, "/learner.sock"); }
};

}  // namespace dbr
