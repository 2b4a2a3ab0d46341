// A window that slides over the rows of a file with one array for each key.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "replay/dataset/hdf5_file.h"
#include "replay/dataset/row_faults.h"

namespace dbr {

// The arrays of the layouts d4rl and d4rl_pybullet.
struct FlatColumns {
  // InvalidArgument for missing keys (all of them, and the keys that are there), other shapes, different
  // lengths.
  static absl::StatusOr<FlatColumns> Open(const Hdf5File& file, bool with_next_observations);

  Hdf5Column observations;
  Hdf5Column actions;
  Hdf5Column rewards;
  Hdf5Column terminals;
  std::optional<Hdf5Column> timeouts;
  // `timeouts` is d3rlpy's `episode_terminals`, which marks the last row of each episode, terminals included.
  bool timeouts_at_every_end = false;
  std::optional<Hdf5Column> next_observations;
};

// Rows in float32, a stretch at a time; the last row of one stretch is the first of the next, for a
// transition needs two:
//
//   file     | 0 ............. 16383 | 16384 ............ |
//   window     [0 ............. rows)
//   Advance                  [0 ............ rows)           row 0 is the last one of before
//
// Thread-compatible.
class RowWindow {
 public:
  static constexpr int kStretch = 16384;  // rows read at once

  // `flags_only`: reads neither observations nor actions nor rewards.
  RowWindow(FlatColumns columns, bool flags_only);

  // Keeps the last row as row 0 and reads the following ones behind it. False where no row was left to read.
  // Errors are Hdf5Column's.
  absl::StatusOr<bool> Advance();

  int rows() const { return rows_; }  // in the window
  // Whether the last row of the file is in the window.
  bool at_end() const { return next_row_ == columns_.rewards.rows(); }

  // Row i of the window, 0 <= i < rows(). Pointers are valid until Advance, and null with flags only.
  const float* observation(int i) const { return At(observations_, columns_.observations, i); }
  const float* action(int i) const { return At(actions_, columns_.actions, i); }
  const float* next_observation(int i) const {
    return At(next_observations_, *columns_.next_observations, i);
  }
  float reward(int i) const { return flags_only_ ? 0 : rewards_[i]; }
  bool terminal(int i) const { return terminals_[i] != 0; }
  bool timeout(int i) const { return columns_.timeouts.has_value() && timeouts_[i] != 0; }
  bool bad(int i) const { return marks_[i] != 0; }

  const FlatColumns& columns() const { return columns_; }
  RowFaults faults() const { return faults_; }

 private:
  const float* At(const std::vector<float>& values, const Hdf5Column& column, int i) const {
    return flags_only_ ? nullptr : values.data() + std::size_t{1} * i * column.width();
  }
  absl::Status Fill(int kept, int count);
  void KeepCuts(int kept, int count);
  absl::Status FillValues(int kept, int count);
  absl::Status FillFloats(const Hdf5Column& column, int kept, int count, std::vector<float>* values);
  absl::Status FillFlags(const Hdf5Column& column, int kept, int count, std::vector<std::uint8_t>* flags);

  const FlatColumns columns_;
  const bool flags_only_;
  std::int64_t next_row_ = 0;  // of the file, to be read next
  int rows_ = 0;               // in the window
  std::vector<float> observations_, actions_, rewards_, next_observations_;
  std::vector<std::uint8_t> terminals_, timeouts_, marks_;
  RowFaults faults_;
};

}  // namespace dbr
