// Films one episode: plays it, draws it and writes it as an animated WebP picture.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "envs/env.h"

namespace dbr {

// Chooses an action [action width] for an observation under a mask.
using ChooseAction = std::function<absl::Status(absl::Span<const float> observation,
                                                absl::Span<const float> mask, absl::Span<float> action)>;

struct FilmOptions {
  std::string path;        // the file, which is replaced as a whole
  std::uint64_t seed = 0;  // the episode's random seed
};

struct FilmSummary {
  int steps = 0;
  double episode_return = 0;
  int frames = 0;
  std::size_t bytes = 0;
};

// Plays the episode and films every fourth step; the film runs at the speed of real time. Blocks for some
// seconds. Returns Cancelled soon after `cancelled` (may be null) becomes true, InvalidArgument for an
// environment without a figure (with the names of those that have one), Internal from the encoder, and the
// errors of `choose` and WriteFileAtomically.
absl::StatusOr<FilmSummary> FilmEpisode(Env& env, const ChooseAction& choose, const FilmOptions& options,
                                        const std::atomic<bool>* cancelled = nullptr);

}  // namespace dbr
