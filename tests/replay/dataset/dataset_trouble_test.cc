// Files that HDF5 cannot read, or reads as something that they do not hold: each is refused with the reason.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/check.h"
#include "tests/replay/dataset/dataset_files.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// A filter of the range that the HDF Group keeps for tests, which no library has.
constexpr H5Z_filter_t kUnknownFilter = 300;

class DatasetTroubleTest : public testing::Test {
 protected:
  std::string Message(DatasetLayout layout = DatasetLayout::kD4rl) {
    const absl::Status status = ReadAll(path_, {.layout = layout}).status();
    EXPECT_FALSE(status.ok());
    code_ = status.code();
    return std::string(status.message());
  }

  // A d4rl file without `rewards`, to be filled in.
  hid_t WriteWithoutRewards() {
    WriteRaw(path_, columns_, {"rewards"});
    file_ = std::make_unique<RawFile>(path_, RawFile::Opening::kAdd);
    return file_->id();
  }

  // Makes `rewards`, which `creation` describes, and writes nothing into it.
  hid_t MakeRewards(hid_t file, hid_t creation) const {
    const hsize_t rows = columns_.rewards.size();
    const hid_t space = H5Screate_simple(1, &rows, nullptr);
    const hid_t array =
        H5Dcreate2(file, "rewards", H5T_IEEE_F32LE, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    DBR_CHECK(array >= 0);
    H5Sclose(space);
    H5Pclose(creation);
    return array;
  }

  const TempDir folder_;
  const std::string path_ = folder_ / "file.hdf5";
  const std::vector<TestEpisode> episodes_ = MakeEpisodes(/*seed=*/1, /*steps=*/100);
  const RawColumns columns_ = D4rlColumns(episodes_);
  std::unique_ptr<RawFile> file_;
  absl::StatusCode code_ = absl::StatusCode::kOk;
};

TEST_F(DatasetTroubleTest, AMissingFilterIsNamedWithTheWayRoundIt) {
  const hid_t file = WriteWithoutRewards();
  const hsize_t rows = columns_.rewards.size(), start = 0;
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(creation, 1, &rows);
  ASSERT_GE(H5Pset_filter(creation, kUnknownFilter, H5Z_FLAG_OPTIONAL, 0, nullptr), 0);
  const hid_t array = MakeRewards(file, creation);
  ASSERT_GE(H5Dwrite_chunk(array, H5P_DEFAULT, 0, &start, 4 * rows, columns_.rewards.data()), 0);
  H5Dclose(array);
  file_.reset();
  EXPECT_THAT(Message(), AllOf(HasSubstr("'rewards'"), HasSubstr("filter 300"),
                               HasSubstr("h5repack -f GZIP=1"), HasSubstr("HDF5_PLUGIN_PATH")));
  EXPECT_EQ(code_, absl::StatusCode::kFailedPrecondition);
}

TEST_F(DatasetTroubleTest, APartOfANewerHdf5IsSaidToBeOne) {
  WriteRaw(path_, columns_, {});
  std::string bytes;
  {
    std::ifstream file(path_, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(file), {});
  }
  const std::string float32("\x11\x20\x1f\x00\x04\x00\x00\x00", 8);  // its first half byte is the version
  const std::size_t place = bytes.find(float32);
  ASSERT_NE(place, std::string::npos);
  bytes[place] = '\x51';
  std::ofstream(path_, std::ios::binary) << bytes;
  EXPECT_THAT(Message(),
              AllOf(HasSubstr("newer HDF5"), HasSubstr("h5repack --high=2"), HasSubstr("libver=")));
  EXPECT_EQ(code_, absl::StatusCode::kFailedPrecondition);
}

TEST_F(DatasetTroubleTest, AFileThatIsStillOpenForWritingIsNotSaidToBeDamaged) {
  const std::string open_path = folder_ / "open.hdf5";
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  const hid_t open_file = H5Fcreate(open_path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  ASSERT_GE(H5Fflush(open_file, H5F_SCOPE_GLOBAL), 0);
  std::filesystem::copy_file(open_path, path_);  // as a killed writer leaves it
  H5Fclose(open_file);
  H5Pclose(access);
  EXPECT_THAT(Message(), AllOf(HasSubstr("open for writing"), HasSubstr("h5clear -s " + path_)));
  EXPECT_EQ(code_, absl::StatusCode::kFailedPrecondition);
}

TEST_F(DatasetTroubleTest, LinksWithoutATargetNameIt) {
  ASSERT_GE(H5Lcreate_soft("/gone", WriteWithoutRewards(), "rewards", H5P_DEFAULT, H5P_DEFAULT), 0);
  file_.reset();
  EXPECT_THAT(Message(), AllOf(HasSubstr("'rewards'"), HasSubstr("a link to /gone, which is not there")));
  ASSERT_GE(H5Lcreate_external("gone.h5", "/r", WriteWithoutRewards(), "rewards", H5P_DEFAULT, H5P_DEFAULT),
            0);
  file_.reset();
  EXPECT_THAT(Message(), HasSubstr("a link to gone.h5:/r, which is not there"));
  const hid_t file = WriteWithoutRewards();
  H5Lcreate_soft("/other", file, "rewards", H5P_DEFAULT, H5P_DEFAULT);
  H5Lcreate_soft("/rewards", file, "other", H5P_DEFAULT, H5P_DEFAULT);
  file_.reset();
  EXPECT_THAT(Message(), HasSubstr("a link to /other, which is not there"));
}

TEST_F(DatasetTroubleTest, DictSpacesAreRefusedWithTheirKeys) {
  WriteMinari(path_, episodes_);
  {
    RawFile file(path_, RawFile::Opening::kAdd);
    file.Remove("episode_0/observations");
    file.Group("episode_0/observations");
    file.Array("episode_0/observations/desired_goal", {1, 2}, 0);
    file.Array("episode_0/observations/observation", {1, 2}, 0);
  }
  EXPECT_THAT(Message(DatasetLayout::kMinari),
              AllOf(HasSubstr("'episode_0/observations'"), HasSubstr("the keys desired_goal, observation"),
                    HasSubstr("dicts")));
}

// As a writer leaves it that made the array in full and was stopped half way.
TEST_F(DatasetTroubleTest, AnArrayOfWhichAPartWasNeverWrittenIsNotReadAsZeros) {
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t rows_of_a_chunk = 10, start = 0;
  H5Pset_chunk(creation, 1, &rows_of_a_chunk);
  const hid_t array = MakeRewards(WriteWithoutRewards(), creation);
  ASSERT_GE(H5Dwrite_chunk(array, H5P_DEFAULT, 0, &start, 4 * rows_of_a_chunk, columns_.rewards.data()), 0);
  H5Dclose(array);
  file_.reset();
  EXPECT_THAT(Message(), AllOf(HasSubstr("'rewards'"), HasSubstr("a part was never written")));
}

TEST_F(DatasetTroubleTest, AnArrayThatNothingWasWrittenIntoIsNotReadAsZeros) {
  H5Dclose(MakeRewards(WriteWithoutRewards(), H5Pcreate(H5P_DATASET_CREATE)));
  file_.reset();
  EXPECT_THAT(Message(), AllOf(HasSubstr("'rewards'"), HasSubstr("nothing was written into")));
}

TEST_F(DatasetTroubleTest, AVirtualArrayWithoutItsFilesIsNotReadAsZeros) {
  const hsize_t rows = columns_.rewards.size();
  const auto write_virtual = [&] {
    const hid_t file = WriteWithoutRewards();
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE), space = H5Screate_simple(1, &rows, nullptr);
    ASSERT_GE(H5Pset_virtual(creation, space, "part.hdf5", "rewards", space), 0);
    H5Sclose(space);
    H5Dclose(MakeRewards(file, creation));
    file_.reset();
  };
  write_virtual();
  EXPECT_THAT(Message(), AllOf(HasSubstr("'rewards'"), HasSubstr("part.hdf5, which is not there")));
  WriteRaw(folder_ / "part.hdf5", columns_, {});
  const absl::StatusOr<Reading> reading = ReadAll(path_, {.layout = DatasetLayout::kD4rl});
  ASSERT_TRUE(reading.ok()) << reading.status();
  EXPECT_EQ(reading->rows[0][kTestObservationSize + kTestActionWidth], episodes_[0].rewards[0]);
}

TEST_F(DatasetTroubleTest, ValuesInAMissingRawFileAreNotSaidToBeDamaged) {
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_external(creation, "rewards.raw", 0, 4 * columns_.rewards.size());
  H5Dclose(MakeRewards(WriteWithoutRewards(), creation));
  file_.reset();
  EXPECT_THAT(Message(), HasSubstr("rewards.raw, which is not there"));
}

TEST_F(DatasetTroubleTest, BitsAreTruthValues) {
  WriteRaw(path_, columns_, {"terminals"});
  const hsize_t rows = columns_.terminals.size();
  const std::vector<std::uint8_t> bits(columns_.terminals.begin(), columns_.terminals.end());
  {
    RawFile file(path_, RawFile::Opening::kAdd);
    const hid_t space = H5Screate_simple(1, &rows, nullptr);
    const hid_t array =
        H5Dcreate2(file.id(), "terminals", H5T_STD_B8LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(H5Dwrite(array, H5T_STD_B8LE, H5S_ALL, H5S_ALL, H5P_DEFAULT, bits.data()), 0);
    H5Dclose(array);
    H5Sclose(space);
  }
  const absl::StatusOr<Reading> reading = ReadAll(path_, {.layout = DatasetLayout::kD4rl, .discount = 0.9f});
  ASSERT_TRUE(reading.ok()) << reading.status();
  ExpectSame(*reading, Expected(episodes_, 0.9f));
}

TEST_F(DatasetTroubleTest, WhatIsNoFileIsRefusedAtOnce) {
  ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
  EXPECT_THAT(Message(), AllOf(HasSubstr(path_), HasSubstr("expected a file, found a pipe")));
  EXPECT_EQ(code_, absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(ReadAll("/dev/zero", {.layout = DatasetLayout::kD4rl}).status().ToString(),
              HasSubstr("found a device"));
}

TEST_F(DatasetTroubleTest, ALoopOfLinksIsSaid) {
  std::filesystem::create_symlink("file.hdf5", path_);
  EXPECT_THAT(Message(), HasSubstr("Too many levels of symbolic links"));
}

}  // namespace
}  // namespace dbr
