// Offline data for tests: episodes, files of every layout made of them, and what a reader says of a file.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/transition.h"
#include "replay/dataset/dataset_reader.h"
#include "replay/dataset/dataset_writer.h"

namespace dbr {

inline constexpr int kTestObservationSize = 3;
inline constexpr int kTestActionWidth = 2;
inline constexpr int kTestMaxEpisodeSteps = 12;

// A robot of the sizes above.
EnvSpec TestRobot();

struct TestEpisode {
  std::vector<float> observations;  // [T + 1][kTestObservationSize]
  std::vector<float> actions;       // [T][kTestActionWidth]
  std::vector<float> rewards;       // [T]
  EpisodeEnding ending = EpisodeEnding::kTerminal;

  int steps() const { return static_cast<int>(rewards.size()); }
  double Return() const;
  EpisodeView View() const { return {observations, actions, rewards, ending}; }
};

// An episode of random numbers, shorter than kTestMaxEpisodeSteps where it ends by a terminal.
TestEpisode MakeEpisode(std::uint64_t seed, int steps, EpisodeEnding ending);

// Episodes of several lengths, some of them cut at kTestMaxEpisodeSteps, `steps` steps or a few more in all.
std::vector<TestEpisode> MakeEpisodes(std::uint64_t seed, int steps);

// Writes arrays as other programs than ours do.
class RawFile {
 public:
  // How an array is stored.
  struct Storage {
    hid_t type = H5T_IEEE_F32LE;
    int chunk_rows = 0;  // 0: contiguous
    int gzip = 0;        // needs chunks
  };

  enum class Opening { kNew, kAdd };  // kAdd: to a file that is there

  explicit RawFile(const std::string& path, Opening opening = Opening::kNew);
  ~RawFile();

  hid_t id() const { return file_; }

  void Group(const std::string& name);
  void Remove(const std::string& name);
  // [rows x width], or [rows] for width 0.
  void Array(const std::string& key, const std::vector<float>& values, int width, const Storage& storage);
  void Array(const std::string& key, const std::vector<float>& values, int width) {
    Array(key, values, width, Storage());
  }
  void TextAttribute(const std::string& name, const std::string& text);

 private:
  hid_t file_;
};

// The columns of a file in layout d4rl or d4rl_pybullet, as floats.
struct RawColumns {
  std::vector<float> observations, actions, rewards, terminals, timeouts, next_observations;
};
RawColumns D4rlColumns(const std::vector<TestEpisode>& episodes);
// The columns as the recipe of d4rl_pybullet writes them: a time limit is a terminal, and there are no
// timeouts.
RawColumns PybulletColumns(const std::vector<TestEpisode>& episodes);

// Keys in `left_out` are not written.
void WriteRaw(const std::string& path, const RawColumns& columns, const std::vector<std::string>& left_out,
              const RawFile::Storage& storage = {});
void WriteMinari(const std::string& path, const std::vector<TestEpisode>& episodes);
void WriteWithWriter(const std::string& path, const std::vector<TestEpisode>& episodes, DatasetLayout layout);

// All that a reader hands out.
struct Reading {
  std::vector<std::vector<float>> rows;
  std::vector<EndedEpisode> ended;  // `index` counts over all chunks
  DatasetFacts facts;
};
absl::StatusOr<Reading> ReadAll(const std::string& path, const DatasetOptions& options, int chunk = 100);

// The same, made from the episodes without a file.
Reading Expected(const std::vector<TestEpisode>& episodes, float discount);

// Expects equal rows, ends and facts, but for facts.rows.
void ExpectSame(const Reading& actual, const Reading& expected);

}  // namespace dbr
