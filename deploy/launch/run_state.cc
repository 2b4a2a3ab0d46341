#include "deploy/launch/run_state.h"

#include <utility>

namespace dbr {
namespace {

constexpr std::pair<RunEnding, absl::string_view> kTexts[] = {
    {RunEnding::kNone, ""},
    {RunEnding::kRunning, "running"},
    {RunEnding::kInterrupted, "interrupted"},
    {RunEnding::kFailed, "failed"},
    {RunEnding::kMaxSeconds, "max_seconds"},
    {RunEnding::kMaxEpisodes, "max_episodes"},
    {RunEnding::kMaxSteps, "max_steps"},
    {RunEnding::kMaxUpdates, "max_updates"},
    {RunEnding::kStopAtReturn, "stop_at_return"},
};

}  // namespace

absl::string_view TextOf(RunEnding ending) {
  for (const auto& [one, text] : kTexts) {
    if (one == ending) return text;
  }
  return "";
}

std::optional<RunEnding> ParseRunEnding(absl::string_view text) {
  for (const auto& [ending, one] : kTexts) {
    if (one == text) return ending;
  }
  return std::nullopt;
}

}  // namespace dbr
