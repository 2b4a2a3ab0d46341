#include "core/safetensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/file_io.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::HasSubstr;

TensorFile SmallFile() {
  return {.tensors = {{"critic", {1.5f, -2, 3}},
                      {"empty", {}},
                      {"policy", {0.25f, std::numeric_limits<float>::max()}}},
          .metadata = {{"updates", "12"}, {"note", "quotes \" and \xc3\xa4"}}};
}

// A file with a hand-made header before `data`.
std::string FileOf(const std::string& header, const std::string& data) {
  const std::uint64_t size = header.size();
  return std::string(reinterpret_cast<const char*>(&size), 8) + header + data;
}

class SafetensorsTest : public testing::Test {
 protected:
  absl::StatusOr<TensorFile> Load(const std::string& bytes) {
    std::filesystem::remove(path_);  // some file systems flush a file that is cut and written again
    std::ofstream(path_, std::ios::binary) << bytes;
    return LoadTensors(path_);
  }
  // The bytes of a good file.
  std::string Saved(const TensorFile& file) {
    EXPECT_TRUE(SaveTensors(file, path_).ok());
    return ReadFile(path_).value();
  }
  // That a hand-made header before `data` is refused by the file's name and with `expected` in the message.
  void ExpectRefused(const std::string& header, const std::string& data, const std::string& expected) {
    const absl::Status status = Load(FileOf(header, data)).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << header;
    EXPECT_THAT(std::string(status.message()), HasSubstr(path_));
    EXPECT_THAT(std::string(status.message()), HasSubstr(expected));
  }

  const TempDir folder_;
  const std::string path_ = folder_ / "file.safetensors";
};

TEST_F(SafetensorsTest, LoadsWhatWasSaved) {
  const TensorFile file = SmallFile();
  Saved(file);
  const auto loaded = LoadTensors(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ(loaded->tensors, file.tensors);
  EXPECT_EQ(loaded->metadata, file.metadata);
}

TEST_F(SafetensorsTest, LoadsAFileWithoutTensors) {
  Saved({});
  const auto loaded = LoadTensors(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_TRUE(loaded->tensors.empty() && loaded->metadata.empty());
}

TEST_F(SafetensorsTest, FollowsThePublishedFormat) {
  const std::string bytes = Saved(SmallFile());
  std::uint64_t header_bytes;
  std::memcpy(&header_bytes, bytes.data(), 8);
  EXPECT_EQ((8 + header_bytes) % 8, 0u);
  const auto header = nlohmann::json::parse(bytes.substr(8, header_bytes), nullptr, false);
  ASSERT_TRUE(header.is_object());
  const auto& policy = header["policy"];
  EXPECT_EQ(policy["dtype"], "F32");
  EXPECT_EQ(policy["shape"], nlohmann::json::array({2}));
  EXPECT_EQ(header["__metadata__"]["updates"], "12");
  float first;
  std::memcpy(&first, bytes.data() + 8 + header_bytes + policy["data_offsets"][0].get<std::size_t>(),
              sizeof first);
  EXPECT_EQ(first, 0.25f);
}

TEST_F(SafetensorsTest, RefusesEveryTruncation) {
  const std::string bytes = Saved(SmallFile());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto loaded = Load(bytes.substr(0, size));
    ASSERT_FALSE(loaded.ok()) << "cut to " << size << " bytes";
    EXPECT_EQ(loaded.status().code(), absl::StatusCode::kDataLoss) << loaded.status();
    EXPECT_THAT(std::string(loaded.status().message()), HasSubstr(path_));
  }
}

TEST_F(SafetensorsTest, RefusesBytesAfterTheData) {
  EXPECT_FALSE(Load(Saved(SmallFile()) + "more").ok());
}

TEST_F(SafetensorsTest, AFlippedBitIsRefusedOrChangesNothing) {
  const TensorFile file = SmallFile();
  const std::string bytes = Saved(file);
  std::uint64_t header_bytes;
  std::memcpy(&header_bytes, bytes.data(), 8);
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] ^= static_cast<char>(1 << (bit % 8));
    const auto loaded = Load(damaged);
    if (!loaded.ok()) {
      EXPECT_EQ(loaded.status().code(), absl::StatusCode::kDataLoss) << loaded.status();
      continue;
    }
    EXPECT_LT(bit / 8, 8 + header_bytes) << "a flip in the data went unnoticed";
    EXPECT_TRUE(loaded->tensors == file.tensors && loaded->metadata == file.metadata) << "bit " << bit;
  }
}

TEST_F(SafetensorsTest, RefusesMalformedHeaders) {
  const std::string eight(8, '\0');
  const std::string metadata = R"("__metadata__":{"crc32c":"00000000","crc32c_header":"00000000"})";
  const auto with = [&](const std::string& entries) { return "{" + metadata + "," + entries + "}"; };
  ExpectRefused("no json", eight, "JSON object");
  ExpectRefused("[1]", eight, "JSON object");
  ExpectRefused("{}", "", "__metadata__");
  ExpectRefused(R"({"__metadata__":{"updates":3}})", "", "text as metadata 'updates'");
  ExpectRefused(with(R"("w":3)"), eight, "dtype, shape and data_offsets");
  ExpectRefused(with(R"("w":{"dtype":"F64","shape":[1],"data_offsets":[0,8]})"), eight,
                "of dtype F32, found \"F64\"");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]})"), eight, "one dimension");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[-2],"data_offsets":[0,8]})"), eight, "one dimension");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[2],"data_offsets":[0]})"), eight, "two data_offsets");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[2],"data_offsets":[0,-8]})"), eight, "two data_offsets");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[2],"data_offsets":[8,16]})"), eight, "within 8 bytes");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[2],"data_offsets":[8,0]})"), eight, "within 8 bytes");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[1],"data_offsets":[2,6]})"), eight, "multiple of 4");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[3],"data_offsets":[0,8]})"), eight, "of 3 floats");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[4611686018427387906],"data_offsets":[0,8]})"), eight,
                "floats");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[1],"data_offsets":[4,8]})"), eight, "at offset 0");
  ExpectRefused(with(R"("w":{"dtype":"F32","shape":[1],"data_offsets":[0,4]})"), eight, "4 bytes of data");
  const std::string whole = R"("v":{"dtype":"F32","shape":[2],"data_offsets":[0,8]})";
  ExpectRefused(with(whole + R"(,"w":{"dtype":"F32","shape":[1],"data_offsets":[4,8]})"), eight,
                "at offset 8");
  ExpectRefused(with(whole), eight, "crc32c_header");
  ExpectRefused(R"({"__metadata__":{"crc32c":"00000000"},)" + whole + "}", eight, "metadata 'crc32c_header'");
}

// Printing or copying such a header would exhaust the stack: both checksums are right until then.
TEST_F(SafetensorsTest, RefusesAHeaderThatIsNestedDeep) {
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  ExpectRefused("{\"__metadata__\":{},\"w\":" + deep + "}", "", "deep within each other");
  ExpectRefused(R"({"w":{"dtype":)" + deep + R"(,"shape":[1],"data_offsets":[0,4]}})", "abcd", "deep within");
  ExpectRefused(std::string(100000, '['), "", "deep within each other");
}

TEST_F(SafetensorsTest, RefusesAHeaderLongerThanTheFile) {
  std::string bytes = Saved(SmallFile());
  for (const std::uint64_t size : {bytes.size() - 7, std::uint64_t{1} << 40, ~std::uint64_t{0}}) {
    std::memcpy(bytes.data(), &size, 8);
    const auto loaded = Load(bytes);
    EXPECT_EQ(loaded.status().code(), absl::StatusCode::kDataLoss) << loaded.status();
  }
}

TEST_F(SafetensorsTest, AMissingFileIsNotFound) {
  EXPECT_EQ(LoadTensors(folder_ / "none").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(SaveTensors(SmallFile(), folder_ / "none/file").code(), absl::StatusCode::kNotFound);
}

PolicySnapshot Snapshot() {
  PolicySnapshot snapshot;
  snapshot.version = 7;
  snapshot.updates = std::uint64_t{1} << 40;
  snapshot.spec = {.env = "connect4",
                   .algorithm = "dbr",
                   .observation_size = 84,
                   .actions = {ActionKind::kDiscrete, 7},
                   .hidden_sizes = {256, 128},
                   .critic_layer_norm = true};
  snapshot.support_epsilon = 0.1f;
  snapshot.networks = {{kPolicyNetwork, {1, 2}}, {kCritic1, {3}}, {kBetaPlus, {4, 5, 6}}};
  return snapshot;
}

class PolicyFileTest : public SafetensorsTest {
 protected:
  // The metadata of a good policy file; LoadAltered() loads the file with another in its place.
  TensorFile Good() {
    EXPECT_TRUE(SavePolicy(Snapshot(), path_).ok());
    return LoadTensors(path_).value();
  }
  absl::Status LoadAltered(const TensorFile& file) {
    EXPECT_TRUE(SaveTensors(file, path_).ok());
    return LoadPolicy(path_).status();
  }
};

TEST_F(PolicyFileTest, LoadsWhatWasSaved) {
  for (const ActionKind kind : {ActionKind::kDiscrete, ActionKind::kContinuous}) {
    PolicySnapshot snapshot = Snapshot();
    snapshot.spec.actions.kind = kind;
    snapshot.spec.critic_layer_norm = kind == ActionKind::kDiscrete;
    ASSERT_TRUE(SavePolicy(snapshot, path_).ok());
    const auto loaded = LoadPolicy(path_);
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    EXPECT_EQ(loaded->version, snapshot.version);
    EXPECT_EQ(loaded->updates, snapshot.updates);
    EXPECT_EQ(loaded->spec, snapshot.spec);
    EXPECT_EQ(loaded->support_epsilon, snapshot.support_epsilon);
    EXPECT_EQ(loaded->networks, snapshot.networks);
    EXPECT_EQ(Checksum(*loaded), Checksum(snapshot));
  }
}

TEST_F(PolicyFileTest, NamesEachMissingField) {
  const TensorFile good = Good();
  ASSERT_GE(good.metadata.size(), 10u);
  for (const auto& [key, value] : good.metadata) {
    if (key == "critic_layer_norm") continue;  // older files do not have it
    TensorFile file = good;
    file.metadata.erase(key);
    const absl::Status status = LoadAltered(file);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("'" + key + "'"));
    EXPECT_THAT(std::string(status.message()), HasSubstr(path_));
  }
}

TEST_F(PolicyFileTest, AnOlderFileHasNoLayerNorm) {
  TensorFile file = Good();
  ASSERT_EQ(file.metadata.at("critic_layer_norm"), "true");
  file.metadata.erase("critic_layer_norm");
  ASSERT_TRUE(SaveTensors(file, path_).ok());
  const auto loaded = LoadPolicy(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_FALSE(loaded->spec.critic_layer_norm);
}

TEST_F(PolicyFileTest, NamesEachFieldThatMakesNoSense) {
  const std::pair<const char*, const char*> bad[] = {
      {"observation_size", "many"},     {"observation_size", "-1"}, {"action_kind", "both"},
      {"action_size", "99999999999"},   {"hidden_sizes", "256,x"},  {"hidden_sizes", "256,0"},
      {"critic_layer_norm", "perhaps"}, {"version", "-7"},          {"support_epsilon", "small"}};
  const TensorFile good = Good();
  for (const auto& [key, value] : bad) {
    TensorFile file = good;
    file.metadata[key] = value;
    const absl::Status status = LoadAltered(file);
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << key << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(std::string("'") + key + "'"));
  }
}

TEST_F(PolicyFileTest, AMissingNetworkIsNamed) {
  TensorFile file = Good();
  file.tensors.erase(kCritic1);
  const absl::Status status = LoadAltered(file);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), HasSubstr("'critic_1'"));
}

TEST_F(PolicyFileTest, AFileWithoutAPolicyIsNotAPolicyFile) {
  PolicySnapshot snapshot = Snapshot();
  snapshot.networks.erase(snapshot.networks.begin());
  ASSERT_TRUE(SavePolicy(snapshot, path_).ok());
  EXPECT_EQ(LoadPolicy(path_).status().code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(SaveTensors({.tensors = {{"weights", {1}}}, .metadata = {{"updates", "1"}}}, path_).ok());
  EXPECT_EQ(LoadPolicy(path_).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(PolicyFileTest, TwoNetworksOfOneNameAreRefused) {
  PolicySnapshot snapshot = Snapshot();
  snapshot.networks.emplace_back(kCritic1, std::vector<float>{9});
  EXPECT_EQ(SavePolicy(snapshot, path_).code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace dbr
