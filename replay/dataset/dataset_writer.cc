#include "replay/dataset/dataset_writer.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "core/check.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "core/temporary_file.h"
#include "replay/dataset/hdf5_id.h"

namespace dbr {
namespace {

constexpr hsize_t kChunkRows = 8192;  // a whole number of them makes a stretch of the reader

absl::Status WriteError(const std::string& path, absl::string_view what) {
  const std::string reason = Hdf5Reason();
  // HDF5 tells of a failed write in a line of numbers, among them the system's error.
  const std::vector<absl::string_view> parts = absl::StrSplit(reason, absl::MaxSplits("errno = ", 1));
  int error_number = 0;
  if (parts.size() == 2 && absl::SimpleAtoi(parts[1].substr(0, parts[1].find(',')), &error_number))
    return ErrnoStatus(error_number, absl::StrCat("cannot ", what), path);
  return absl::InternalError(absl::StrCat("cannot ", what, " ", path, ": ", reason));
}

// Truth values as h5py has them, so that Python reads them as bool.
Hdf5Id BooleanType() {
  Hdf5Id type(H5Tenum_create(H5T_STD_I8LE), H5Tclose);
  const std::int8_t no = 0, yes = 1;
  H5Tenum_insert(type.get(), "FALSE", &no);
  H5Tenum_insert(type.get(), "TRUE", &yes);
  return type;
}

// An array that grows by rows.
class GrowingArray {
 public:
  // `width` 0: [rows], else [rows, width].
  static absl::StatusOr<GrowingArray> Create(hid_t file, const std::string& path, const char* name,
                                             hid_t type, std::pair<int, int> width_and_compression) {
    const auto [width, compression] = width_and_compression;
    const int rank = width > 0 ? 2 : 1;
    const hsize_t none[2] = {0, static_cast<hsize_t>(width)};
    const hsize_t limit[2] = {H5S_UNLIMITED, static_cast<hsize_t>(width)};
    const hsize_t chunk[2] = {kChunkRows, static_cast<hsize_t>(width)};
    const Hdf5Id space(H5Screate_simple(rank, none, limit), H5Sclose);
    const Hdf5Id creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(creation.get(), rank, chunk);
    H5Pset_obj_track_times(creation.get(), false);  // the same rows make the same bytes
    if (compression > 0) {
      H5Pset_shuffle(creation.get());
      H5Pset_deflate(creation.get(), static_cast<unsigned>(compression));
    }
    GrowingArray array;
    array.width_ = width;
    array.array_ =
        Hdf5Id(H5Dcreate2(file, name, type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT), H5Dclose);
    if (!array.array_.ok()) return WriteError(path, "write");
    return array;
  }

  absl::Status Append(const std::string& path, hid_t memory_type, const void* values, hsize_t count) {
    const int rank = width_ > 0 ? 2 : 1;
    const hsize_t start[2] = {rows_, 0};
    const hsize_t extent[2] = {count, static_cast<hsize_t>(width_)};
    const hsize_t size[2] = {rows_ + count, static_cast<hsize_t>(width_)};
    if (H5Dset_extent(array_.get(), size) < 0) return WriteError(path, "write");
    const Hdf5Id space(H5Dget_space(array_.get()), H5Sclose);
    const Hdf5Id memory(H5Screate_simple(rank, extent, nullptr), H5Sclose);
    H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start, nullptr, extent, nullptr);
    if (H5Dwrite(array_.get(), memory_type, memory.get(), space.get(), H5P_DEFAULT, values) < 0) {
      return WriteError(path, "write");
    }
    rows_ += count;
    return absl::OkStatus();
  }

  bool Close() { return array_.Close(); }

 private:
  Hdf5Id array_;
  int width_ = 0;
  hsize_t rows_ = 0;
};

bool WriteText(hid_t file, const char* name, const std::string& text) {
  const Hdf5Id type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), std::max<std::size_t>(text.size(), 1));
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  const Hdf5Id space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Id attribute(H5Acreate2(file, name, type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  return attribute.ok() && H5Awrite(attribute.get(), type.get(), text.c_str()) >= 0;
}

bool WriteNumber(hid_t file, const char* name, std::int64_t number) {
  const Hdf5Id space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Id attribute(H5Acreate2(file, name, H5T_STD_I64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  return attribute.ok() && H5Awrite(attribute.get(), H5T_NATIVE_INT64, &number) >= 0;
}

}  // namespace

struct DatasetWriter::State {
  ~State() {
    if (finished) return;
    Close();  // before the temporary is removed
  }

  absl::Status Create();
  void AddRow(const EpisodeView& episode, int t);
  void AddFlags(bool terminal, bool timeout);
  absl::Status Flush();
  bool Close();

  bool shifted() const { return options.layout == DatasetLayout::kD4rlPybullet; }

  std::string path;
  std::unique_ptr<TemporaryFile> file_on_disk;  // beside it
  DatasetWriterOptions options;
  bool finished = false;
  bool unfinished_episode = false;  // the last one added

  Hdf5Id file;
  Hdf5Id boolean;
  std::optional<GrowingArray> observation_array, action_array, reward_array, terminal_array, timeout_array,
      next_observation_array;
  // Rows that are not yet in the file; the last one always is among them, for its flags may change.
  std::vector<float> observations, actions, rewards, next_observations;
  std::vector<std::int8_t> terminals, timeouts;
};

absl::Status DatasetWriter::State::Create() {
  SilenceHdf5();
  ASSIGN_OR_RETURN(file_on_disk, TemporaryFile::Create(path));
  // The temporary file has a lock of its own, and on a network file system HDF5's would be refused for it.
  const Hdf5Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access.get(), /*use_file_locking=*/false, /*ignore_when_disabled=*/true);
  file = Hdf5Id(H5Fcreate(file_on_disk->name().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), H5Fclose);
  if (!file.ok()) return WriteError(path, "create");
  boolean = BooleanType();
  if (!WriteText(file.get(), "layout", DatasetLayoutName(options.layout)) ||
      !WriteText(file.get(), "env", options.env.name) ||
      !WriteNumber(file.get(), "max_episode_steps", options.env.max_episode_steps)) {
    return WriteError(path, "write");
  }
  const auto make = [&](const char* name, hid_t type, int width) {
    return GrowingArray::Create(file.get(), path, name, type, {width, options.compression});
  };
  const int observation_size = options.env.observation_size;
  ASSIGN_OR_RETURN(observation_array, make("observations", H5T_IEEE_F32LE, observation_size));
  ASSIGN_OR_RETURN(action_array, make("actions", H5T_IEEE_F32LE, options.env.actions.width()));
  ASSIGN_OR_RETURN(reward_array, make("rewards", H5T_IEEE_F32LE, 0));
  ASSIGN_OR_RETURN(terminal_array, make("terminals", boolean.get(), 0));
  ASSIGN_OR_RETURN(timeout_array, make("timeouts", boolean.get(), 0));
  if (!shifted()) {
    ASSIGN_OR_RETURN(next_observation_array, make("next_observations", H5T_IEEE_F32LE, observation_size));
  }
  return absl::OkStatus();
}

void DatasetWriter::State::AddFlags(bool terminal, bool timeout) {
  terminals.push_back(terminal);
  timeouts.push_back(timeout);
}

// Row t of an episode: a step, or, in d4rl_pybullet with t = steps(), where it arrived.
void DatasetWriter::State::AddRow(const EpisodeView& episode, int t) {
  const std::size_t size = options.env.observation_size, width = options.env.actions.width();
  const int steps = episode.steps();
  const auto observation = episode.observations.subspan(t * size, size);
  observations.insert(observations.end(), observation.begin(), observation.end());
  if (t < steps) {
    const auto action = episode.actions.subspan(t * width, width);
    actions.insert(actions.end(), action.begin(), action.end());
  } else {
    actions.resize(actions.size() + width, 0.0f);
  }
  const bool last = t + 1 == (shifted() ? steps + 1 : steps);
  const bool cut = last && episode.ending == EpisodeEnding::kTimeLimit;
  const bool terminal = last && episode.ending == EpisodeEnding::kTerminal;
  if (shifted()) {
    rewards.push_back(t == 0 ? 0.0f : episode.rewards[t - 1]);
    AddFlags(terminal || cut, cut);
    return;
  }
  rewards.push_back(episode.rewards[t]);
  AddFlags(terminal, cut);
  const auto next = episode.observations.subspan((t + 1) * size, size);
  next_observations.insert(next_observations.end(), next.begin(), next.end());
}

absl::Status DatasetWriter::State::Flush() {
  const hsize_t count = rewards.size();
  if (count == 0) return absl::OkStatus();
  RETURN_IF_ERROR(observation_array->Append(path, H5T_NATIVE_FLOAT, observations.data(), count));
  RETURN_IF_ERROR(action_array->Append(path, H5T_NATIVE_FLOAT, actions.data(), count));
  RETURN_IF_ERROR(reward_array->Append(path, H5T_NATIVE_FLOAT, rewards.data(), count));
  RETURN_IF_ERROR(terminal_array->Append(path, boolean.get(), terminals.data(), count));
  RETURN_IF_ERROR(timeout_array->Append(path, boolean.get(), timeouts.data(), count));
  if (!shifted()) {
    RETURN_IF_ERROR(next_observation_array->Append(path, H5T_NATIVE_FLOAT, next_observations.data(), count));
  }
  for (std::vector<float>* const values : {&observations, &actions, &rewards, &next_observations})
    values->clear();
  terminals.clear();
  timeouts.clear();
  return absl::OkStatus();
}

bool DatasetWriter::State::Close() {
  bool closed = true;
  for (auto* const array : {&observation_array, &action_array, &reward_array, &terminal_array, &timeout_array,
                            &next_observation_array}) {
    if (array->has_value()) closed = (*array)->Close() && closed;
  }
  closed = boolean.Close() && closed;
  return file.Close() && closed;
}

absl::StatusOr<std::unique_ptr<DatasetWriter>> DatasetWriter::Create(const std::string& path,
                                                                     const DatasetWriterOptions& options) {
  if (options.layout == DatasetLayout::kMinari) {
    return absl::InvalidArgumentError(
        "files are written in layout d4rl or d4rl_pybullet, found minari; name one of the two");
  }
  if (options.env.actions.discrete()) {
    return absl::InvalidArgumentError(absl::StrCat("expected an environment with continuous actions, found ",
                                                   options.env.name,
                                                   "; these layouts hold no legal-action masks"));
  }
  auto state = std::make_unique<State>();
  state->path = path;
  state->options = options;
  RETURN_IF_ERROR(state->Create());
  return std::unique_ptr<DatasetWriter>(new DatasetWriter(std::move(state)));
}

DatasetWriter::DatasetWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
DatasetWriter::~DatasetWriter() = default;

absl::Status DatasetWriter::Append(const EpisodeView& episode) {
  SilenceHdf5();
  const int steps = episode.steps();
  const EnvSpec& env = state_->options.env;
  DBR_CHECK(steps > 0 && !state_->finished);
  DBR_CHECK(episode.observations.size() == std::size_t{1} * (steps + 1) * env.observation_size);
  DBR_CHECK(episode.actions.size() == std::size_t{1} * steps * env.actions.width());
  if (state_->unfinished_episode) {
    state_->timeouts.back() = 1;
    if (state_->shifted()) state_->terminals.back() = 1;
  }
  if (state_->rewards.size() >= kChunkRows) RETURN_IF_ERROR(state_->Flush());
  const int rows = state_->shifted() ? steps + 1 : steps;
  for (int t = 0; t < rows; ++t) state_->AddRow(episode, t);
  state_->unfinished_episode = episode.ending == EpisodeEnding::kUnfinished;
  return absl::OkStatus();
}

absl::Status DatasetWriter::Finish() {
  SilenceHdf5();
  DBR_CHECK(!state_->finished);
  RETURN_IF_ERROR(state_->Flush());
  if (!state_->Close()) return WriteError(state_->path, "write");
  RETURN_IF_ERROR(state_->file_on_disk->Commit());
  state_->finished = true;
  return absl::OkStatus();
}

}  // namespace dbr
