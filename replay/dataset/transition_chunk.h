// A stretch of transitions that a reader of offline data hands out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "core/check.h"
#include "core/transition.h"

namespace dbr {

// An episode that ends with a transition of the chunk.
struct EndedEpisode {
  int index = 0;          // of the transition in the chunk
  bool terminal = false;  // else cut at the time limit
  EpisodeEnd end;         // its return and length count rows without a transition too
};

// Rows of layout.stride() floats, as core/transition.h lays them, one after another. Plain values: the caller
// owns a chunk and has it refilled; it allocates once.
struct TransitionChunk {
  // `room`: rows that fit, at least 1.
  TransitionChunk(const TransitionLayout& transition_layout, int room)
      : layout(transition_layout), capacity(room) {
    DBR_CHECK(room > 0);
    values.resize(std::size_t{1} * room * layout.stride());
    starts.reserve(room);
  }

  const float* row(int i) const { return values.data() + std::size_t{1} * i * layout.stride(); }
  float* row(int i) { return values.data() + std::size_t{1} * i * layout.stride(); }
  // All rows [size x stride], for one copy.
  absl::Span<const float> rows() const { return {values.data(), std::size_t{1} * size * layout.stride()}; }

  TransitionLayout layout;
  int capacity;
  int size = 0;               // rows that hold a transition
  std::vector<float> values;  // [capacity x stride]
  // [size], 1 where a transition does not follow the one before it (a new episode, or a gap).
  std::vector<std::uint8_t> starts;
  std::vector<EndedEpisode> ended;  // by rising index
};

}  // namespace dbr
