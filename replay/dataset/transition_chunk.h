// A stretch of transitions on their way out of a file.
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
  EpisodeEnd end;         // return and length are those of the data, rows without a transition included
};

// Flat rows of layout.stride() floats, as core/transition.h lays them out, one after another. The caller owns
// a chunk and has it refilled; it allocates once.
struct TransitionChunk {
  TransitionChunk(const TransitionLayout& transition_layout, int room)
      : layout(transition_layout), capacity(room) {
    DBR_CHECK(room > 0);
    values.resize(std::size_t{1} * room * layout.stride());
    starts.reserve(room);
  }

  const float* row(int i) const { return values.data() + std::size_t{1} * i * layout.stride(); }
  float* row(int i) { return values.data() + std::size_t{1} * i * layout.stride(); }
  // All rows, for one copy.
  absl::Span<const float> rows() const { return {values.data(), std::size_t{1} * size * layout.stride()}; }

  TransitionLayout layout;
  int capacity;
  int size = 0;               // rows that hold a transition
  std::vector<float> values;  // [capacity x stride]
  std::vector<std::uint8_t>
      starts;  // [size] 1: does not follow the transition before it (a new episode, or a gap)
  std::vector<EndedEpisode> ended;  // by rising index
};

}  // namespace dbr
