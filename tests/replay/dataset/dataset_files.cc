#include "tests/replay/dataset/dataset_files.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "core/check.h"
#include "core/rng.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

void Append(const std::vector<float>& from, std::vector<float>* to) {
  to->insert(to->end(), from.begin(), from.end());
}

std::vector<float> Flags(int steps, bool last) {
  std::vector<float> flags(steps, 0.0f);
  flags.back() = last;
  return flags;
}

}  // namespace

EnvSpec TestRobot() {
  return {.name = "test_robot",
          .observation_size = kTestObservationSize,
          .actions = {ActionKind::kContinuous, kTestActionWidth},
          .max_episode_steps = kTestMaxEpisodeSteps};
}

double TestEpisode::Return() const {
  return std::accumulate(rewards.begin(), rewards.end(), 0.0);
}

TestEpisode MakeEpisode(std::uint64_t seed, int steps, EpisodeEnding ending) {
  Rng rng(seed);
  const auto draw = [&](int count) {
    std::vector<float> values(count);
    for (float& value : values) value = static_cast<float>(rng.Normal());
    return values;
  };
  TestEpisode episode;
  episode.observations = draw((steps + 1) * kTestObservationSize);
  episode.actions.resize(static_cast<std::size_t>(steps) * kTestActionWidth);
  for (float& value : episode.actions) value = static_cast<float>(2 * rng.Uniform() - 1);
  episode.rewards = draw(steps);
  episode.ending = ending;
  return episode;
}

std::vector<TestEpisode> MakeEpisodes(std::uint64_t seed, int steps) {
  Rng rng(seed);
  std::vector<TestEpisode> episodes;
  while (steps > 0) {
    const int length = 1 + static_cast<int>(rng.Below(kTestMaxEpisodeSteps));
    const bool cut = length == kTestMaxEpisodeSteps;
    episodes.push_back(
        MakeEpisode(rng(), length, cut ? EpisodeEnding::kTimeLimit : EpisodeEnding::kTerminal));
    steps -= length;
  }
  return episodes;
}

RawFile::RawFile(const std::string& path, Opening opening)
    : file_(opening == Opening::kNew ? H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)
                                     : H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)) {
  DBR_CHECK(file_ >= 0);
}

RawFile::~RawFile() {
  H5Fclose(file_);
}

void RawFile::Group(const std::string& name) {
  const hid_t group = H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  DBR_CHECK(group >= 0);
  H5Gclose(group);
}

void RawFile::Remove(const std::string& name) {
  DBR_CHECK(H5Ldelete(file_, name.c_str(), H5P_DEFAULT) >= 0);
}

void RawFile::Array(const std::string& key, const std::vector<float>& values, int width,
                    const Storage& storage) {
  const int rank = width > 0 ? 2 : 1;
  const hsize_t extent[2] = {values.size() / std::max(width, 1), static_cast<hsize_t>(width)};
  const hsize_t chunk[2] = {static_cast<hsize_t>(storage.chunk_rows), static_cast<hsize_t>(width)};
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  if (storage.chunk_rows > 0) H5Pset_chunk(creation, rank, chunk);
  if (storage.gzip > 0) H5Pset_deflate(creation, static_cast<unsigned>(storage.gzip));
  const hid_t space = H5Screate_simple(rank, extent, nullptr);
  const hid_t array = H5Dcreate2(file_, key.c_str(), storage.type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
  DBR_CHECK(array >= 0);
  if (H5Tget_class(storage.type) == H5T_ENUM) {
    const std::vector<std::int8_t> bytes(values.begin(), values.end());
    DBR_CHECK(H5Dwrite(array, storage.type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) >= 0);
  } else {
    DBR_CHECK(H5Dwrite(array, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) >= 0);
  }
  H5Dclose(array);
  H5Sclose(space);
  H5Pclose(creation);
}

void RawFile::TextAttribute(const std::string& name, const std::string& text) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, H5T_VARIABLE);  // as h5py writes them
  const hid_t space = H5Screate(H5S_SCALAR);
  const hid_t attribute = H5Acreate2(file_, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT);
  const char* const letters = text.c_str();
  DBR_CHECK(H5Awrite(attribute, type, &letters) >= 0);
  H5Aclose(attribute);
  H5Sclose(space);
  H5Tclose(type);
}

RawColumns D4rlColumns(const std::vector<TestEpisode>& episodes) {
  RawColumns columns;
  for (const TestEpisode& episode : episodes) {
    const auto& observations = episode.observations;
    columns.observations.insert(columns.observations.end(), observations.begin(),
                                observations.end() - kTestObservationSize);
    columns.next_observations.insert(columns.next_observations.end(),
                                     observations.begin() + kTestObservationSize, observations.end());
    Append(episode.actions, &columns.actions);
    Append(episode.rewards, &columns.rewards);
    Append(Flags(episode.steps(), episode.ending == EpisodeEnding::kTerminal), &columns.terminals);
    Append(Flags(episode.steps(), episode.ending == EpisodeEnding::kTimeLimit), &columns.timeouts);
  }
  return columns;
}

RawColumns PybulletColumns(const std::vector<TestEpisode>& episodes) {
  RawColumns columns;
  for (const TestEpisode& episode : episodes) {
    Append(episode.observations, &columns.observations);
    Append(episode.actions, &columns.actions);
    Append(std::vector<float>(kTestActionWidth, 0.0f), &columns.actions);
    columns.rewards.push_back(0);
    Append(episode.rewards, &columns.rewards);
    columns.terminals.push_back(0);
    Append(Flags(episode.steps(), episode.ending != EpisodeEnding::kUnfinished), &columns.terminals);
  }
  return columns;
}

void WriteRaw(const std::string& path, const RawColumns& columns, const std::vector<std::string>& left_out,
              const RawFile::Storage& storage) {
  RawFile file(path);
  const auto write = [&](const std::string& key, const std::vector<float>& values, int width) {
    if (values.empty() || std::count(left_out.begin(), left_out.end(), key) > 0) return;
    file.Array(key, values, width, storage);
  };
  write("observations", columns.observations, kTestObservationSize);
  write("actions", columns.actions, kTestActionWidth);
  write("rewards", columns.rewards, 0);
  write("terminals", columns.terminals, 0);
  write("timeouts", columns.timeouts, 0);
  write("next_observations", columns.next_observations, kTestObservationSize);
}

void WriteMinari(const std::string& path, const std::vector<TestEpisode>& episodes) {
  RawFile file(path);
  for (std::size_t i = 0; i < episodes.size(); ++i) {
    const TestEpisode& episode = episodes[i];
    const std::string group = "episode_" + std::to_string(i);
    file.Group(group);
    file.Array(group + "/observations", episode.observations, kTestObservationSize);
    file.Array(group + "/actions", episode.actions, kTestActionWidth);
    file.Array(group + "/rewards", episode.rewards, 0);
    file.Array(group + "/terminations", Flags(episode.steps(), episode.ending == EpisodeEnding::kTerminal),
               0);
    file.Array(group + "/truncations", Flags(episode.steps(), episode.ending == EpisodeEnding::kTimeLimit),
               0);
  }
}

void WriteWithWriter(const std::string& path, const std::vector<TestEpisode>& episodes,
                     DatasetLayout layout) {
  auto writer = DatasetWriter::Create(path, {.layout = layout, .env = TestRobot()});
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (const TestEpisode& episode : episodes) {
    const absl::Status appended = (*writer)->Append(episode.View());
    ASSERT_TRUE(appended.ok()) << appended;
  }
  const absl::Status finished = (*writer)->Finish();
  ASSERT_TRUE(finished.ok()) << finished;
}

absl::StatusOr<Reading> ReadAll(const std::string& path, const DatasetOptions& options, int chunk) {
  ASSIGN_OR_RETURN(const std::unique_ptr<DatasetReader> reader, DatasetReader::Open(path, options));
  TransitionChunk transitions(reader->transition_layout(), chunk);
  Reading reading;
  while (true) {
    ASSIGN_OR_RETURN(const int size, reader->Next(&transitions));
    for (EndedEpisode ended : transitions.ended) {
      ended.index += static_cast<int>(reading.rows.size());
      reading.ended.push_back(ended);
    }
    for (int i = 0; i < size; ++i) {
      const float* const row = transitions.row(i);
      reading.rows.emplace_back(row, row + transitions.layout.stride());
    }
    if (size < chunk) break;
  }
  reading.facts = reader->facts();
  return reading;
}

Reading Expected(const std::vector<TestEpisode>& episodes, float discount) {
  Reading reading;
  std::vector<double> returns;
  for (const TestEpisode& episode : episodes) {
    const bool terminal = episode.ending == EpisodeEnding::kTerminal;
    for (int t = 0; t < episode.steps(); ++t) {
      const auto observation = episode.observations.begin() + t * kTestObservationSize;
      const auto action = episode.actions.begin() + t * kTestActionWidth;
      std::vector<float> row(observation, observation + kTestObservationSize);
      row.insert(row.end(), action, action + kTestActionWidth);
      row.push_back(episode.rewards[t]);
      row.push_back(terminal && t + 1 == episode.steps() ? 0 : discount);
      row.insert(row.end(), observation + kTestObservationSize, observation + 2 * kTestObservationSize);
      reading.rows.push_back(row);
    }
    if (episode.ending == EpisodeEnding::kUnfinished) continue;
    EndedEpisode ended;
    ended.index = static_cast<int>(reading.rows.size()) - 1;
    ended.terminal = terminal;
    ended.end.episode_return = static_cast<float>(episode.Return());
    ended.end.length = episode.steps();
    reading.ended.push_back(ended);
    ++(terminal ? reading.facts.terminals : reading.facts.timeouts);
    returns.push_back(episode.Return());
  }
  DatasetFacts& facts = reading.facts;
  facts.transitions = static_cast<std::int64_t>(reading.rows.size());
  facts.episodes = static_cast<std::int64_t>(returns.size());
  if (returns.empty()) return reading;
  const double count = static_cast<double>(returns.size());
  facts.return_mean = std::accumulate(returns.begin(), returns.end(), 0.0) / count;
  double squares = 0;
  for (const double value : returns) squares += (value - facts.return_mean) * (value - facts.return_mean);
  facts.return_std = std::sqrt(squares / count);
  facts.return_min = *std::min_element(returns.begin(), returns.end());
  facts.return_max = *std::max_element(returns.begin(), returns.end());
  facts.returns.assign(returns.begin(), returns.end());
  return reading;
}

void ExpectSame(const Reading& actual, const Reading& expected) {
  ASSERT_EQ(actual.rows.size(), expected.rows.size());
  for (std::size_t i = 0; i < expected.rows.size(); ++i)
    ASSERT_EQ(actual.rows[i], expected.rows[i]) << "row " << i;
  ASSERT_EQ(actual.ended.size(), expected.ended.size());
  for (std::size_t i = 0; i < expected.ended.size(); ++i) {
    const EndedEpisode &mine = actual.ended[i], &other = expected.ended[i];
    EXPECT_EQ(mine.index, other.index);
    EXPECT_EQ(mine.terminal, other.terminal);
    EXPECT_EQ(mine.end.length, other.end.length);
    EXPECT_NEAR(mine.end.episode_return, other.end.episode_return, 1e-5);
  }
  EXPECT_EQ(actual.facts.transitions, expected.facts.transitions);
  EXPECT_EQ(actual.facts.episodes, expected.facts.episodes);
  EXPECT_EQ(actual.facts.terminals, expected.facts.terminals);
  EXPECT_EQ(actual.facts.timeouts, expected.facts.timeouts);
  EXPECT_EQ(actual.facts.bad_rows, expected.facts.bad_rows);
  if (expected.facts.episodes == 0) return;
  EXPECT_NEAR(actual.facts.return_mean, expected.facts.return_mean, 1e-9);
  EXPECT_NEAR(actual.facts.return_std, expected.facts.return_std, 1e-9);
  EXPECT_NEAR(actual.facts.return_min, expected.facts.return_min, 1e-9);
  EXPECT_NEAR(actual.facts.return_max, expected.facts.return_max, 1e-9);
  ASSERT_EQ(actual.facts.returns.size(), expected.facts.returns.size());
  for (std::size_t i = 0; i < actual.facts.returns.size(); ++i)
    EXPECT_NEAR(actual.facts.returns[i], expected.facts.returns[i], 1e-3) << i;
}

}  // namespace dbr
