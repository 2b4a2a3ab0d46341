// The speed of reading offline data from HDF5 files into flat transitions, for a robot with the hopper's
// sizes.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/rng.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/dataset_writer.h"

namespace dbr {
namespace {

constexpr int kObservationSize = 15;
constexpr int kActionWidth = 3;
constexpr int kSteps = 1000;
constexpr int kEpisodes = 200;

// A file of smooth random walks. It is removed at the end.
class BenchFile {
 public:
  BenchFile(DatasetLayout layout, int compression)
      : folder_(std::filesystem::temp_directory_path() / "dbr-bench-XXXXXX") {
    DBR_CHECK(mkdtemp(folder_.data()) != nullptr);
    const EnvSpec env = {.name = "bench",
                         .observation_size = kObservationSize,
                         .actions = {ActionKind::kContinuous, kActionWidth},
                         .max_episode_steps = kSteps};
    auto writer = DatasetWriter::Create(path(), {.layout = layout, .env = env, .compression = compression});
    DBR_CHECK(writer.ok());
    for (int i = 0; i < kEpisodes; ++i) {
      const std::vector<float> observations = Walk(i, (kSteps + 1) * kObservationSize);
      const std::vector<float> actions = Walk(i + kEpisodes, kSteps * kActionWidth);
      const std::vector<float> rewards = Walk(i + 2 * kEpisodes, kSteps);
      DBR_CHECK((*writer)->Append({observations, actions, rewards, EpisodeEnding::kTimeLimit}).ok());
    }
    DBR_CHECK((*writer)->Finish().ok());
  }
  ~BenchFile() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  BenchFile(const BenchFile&) = delete;
  BenchFile& operator=(const BenchFile&) = delete;

  std::string path() const { return folder_ + "/data.hdf5"; }

 private:
  static std::vector<float> Walk(std::uint64_t seed, int count) {
    Rng rng(seed);
    std::vector<float> values(count);
    float at = 0;
    for (float& value : values) value = at = 0.9f * at + 0.1f * static_cast<float>(rng.Normal());
    return values;
  }

  std::string folder_;
};

void BM_DatasetRead(benchmark::State& state, DatasetLayout layout, int compression) {
  const BenchFile file(layout, compression);
  std::int64_t rows = 0;
  for (auto _ : state) {
    const auto reader = DatasetReader::Open(file.path(), {});
    DBR_CHECK(reader.ok());
    TransitionChunk chunk((*reader)->transition_layout(), 8192);
    while (true) {
      const absl::StatusOr<int> size = (*reader)->Next(&chunk);
      DBR_CHECK(size.ok());
      if (*size == 0) break;
      benchmark::DoNotOptimize(chunk.values.data());
    }
    rows += (*reader)->facts().transitions;
  }
  state.SetItemsProcessed(rows);
}

BENCHMARK_CAPTURE(BM_DatasetRead, d4rl, DatasetLayout::kD4rl, 0)->Name("DatasetRead/d4rl");
BENCHMARK_CAPTURE(BM_DatasetRead, d4rl_gzip, DatasetLayout::kD4rl, 1)->Name("DatasetRead/d4rl/gzip");
BENCHMARK_CAPTURE(BM_DatasetRead, pybullet, DatasetLayout::kD4rlPybullet, 0)
    ->Name("DatasetRead/d4rl_pybullet");
BENCHMARK_CAPTURE(BM_DatasetRead, pybullet_gzip, DatasetLayout::kD4rlPybullet, 1)
    ->Name("DatasetRead/d4rl_pybullet/gzip");

}  // namespace
}  // namespace dbr
