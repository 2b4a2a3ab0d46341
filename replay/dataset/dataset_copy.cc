#include "replay/dataset/dataset_copy.h"

#include "core/status_macros.h"
#include "replay/dataset/episode.h"

namespace dbr {
namespace {

constexpr int kChunk = 4096;

// Puts transitions together to episodes.
class EpisodeCopier {
 public:
  explicit EpisodeCopier(DatasetWriter* writer) : writer_(writer) {}

  absl::Status Add(const TransitionChunk& chunk) {
    std::size_t next_ended = 0;
    for (int i = 0; i < chunk.size; ++i) {
      if (chunk.starts[i]) RETURN_IF_ERROR(Flush());
      AddTransition(chunk.layout, chunk.row(i));
      const bool ended = next_ended < chunk.ended.size() && chunk.ended[next_ended].index == i;
      if (ended && !chunk.ended[next_ended++].terminal) episode_.ending = EpisodeEnding::kTimeLimit;
      if (chunk.row(i)[chunk.layout.discount_offset()] == 0) episode_.ending = EpisodeEnding::kTerminal;
    }
    return absl::OkStatus();
  }

  // Writes what there is of the episode.
  absl::Status Flush() {
    if (episode_.steps() == 0) return absl::OkStatus();
    episode_.AddObservation(last_observation_);
    RETURN_IF_ERROR(writer_->Append(episode_.View()));
    episode_.Clear();
    return absl::OkStatus();
  }

 private:
  void AddTransition(const TransitionLayout& layout, const float* row) {
    const std::size_t size = layout.observation_width, width = layout.action_width;
    episode_.AddObservation({row, size});
    episode_.AddAction({row + layout.action_offset(), width}, row[layout.reward_offset()]);
    const float* const next = row + layout.next_observation_offset();
    last_observation_.assign(next, next + size);
  }

  DatasetWriter* const writer_;
  EpisodeRows episode_;  // without the last step's next observation
  std::vector<float> last_observation_;
};

}  // namespace

absl::Status CopyDataset(DatasetReader* reader, DatasetWriter* writer,
                         const std::function<bool(std::int64_t)>& go_on) {
  TransitionChunk chunk(reader->transition_layout(), kChunk);
  EpisodeCopier copier(writer);
  while (true) {
    ASSIGN_OR_RETURN(const int size, reader->Next(&chunk));
    if (size == 0) return copier.Flush();
    RETURN_IF_ERROR(copier.Add(chunk));
    if (!go_on(reader->facts().transitions)) return absl::CancelledError("the copy was stopped");
  }
}

}  // namespace dbr
