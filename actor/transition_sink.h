// Where an actor's transitions go.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "absl/status/status.h"
#include "core/transition.h"

namespace dbr {

// Takes one transition, which is valid during the call. With it come its first advantage (kUnjudged where
// there is none), the version of the critic that gave it, and the result of the episode where this transition
// ended it.
using TransitionSink =
    std::function<absl::Status(const TransitionView& transition, float advantage,
                               std::uint64_t critic_version, const std::optional<EpisodeEnd>& end)>;

}  // namespace dbr
