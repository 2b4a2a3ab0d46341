// The floors of the house: a room includes only from floors below, and rooms of one floor are blind to each
// other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

namespace dbr {
namespace {

struct Room {
  std::string name;
  int floor;
  std::vector<std::string> prefixes;  // of the paths of its files
};

// Of the rooms whose prefix fits a path, the one with the longest such prefix holds it. A file in replay/ is
// the buffer's unless it is named after a service, client or writer; one in learner/ is the runtime's unless
// it is an algorithm's.
const std::vector<Room>& Rooms() {
  static const auto* rooms = new std::vector<Room>{
      {"core", 0, {"core/"}},
      {"config schema", 0, {"proto/config.pb.h", "proto/experiment.pb.h"}},
      {"config reader", 1, {"proto/config_", "proto/experiment_"}},
      {"wire", 1, {"proto/"}},
      {"nn", 1, {"nn/"}},
      {"envs", 1, {"envs/"}},
      {"replay buffer", 1, {"replay/", "replay/store/writer_table"}},
      {"offline data", 1, {"replay/dataset/"}},
      {"algorithms", 2, {"learner/algorithm.h", "learner/algorithms/", "learner/parts/"}},
      {"replay service",
       2,
       {"replay/service/service", "replay/service/replay_server", "replay/service/seed_import",
        "replay/client/client", "replay/client/writer", "replay/client/outbox", "replay/client/await_stats"}},
      {"actor", 3, {"actor/"}},
      {"learner runtime", 3, {"learner/"}},
      {"deploy", 4, {"deploy/"}},
  };
  return *rooms;
}

// Whether `included` opens onto network, clock or files.
bool IsOutsideWorld(const std::string& included) {
  static const auto* headers = new std::set<std::string>{
      "absl/time/clock.h", "chrono",   "ctime",          "fstream",           "filesystem",
      "fcntl.h",           "unistd.h", "core/file_io.h", "core/run_folder.h", "core/shutdown.h"};
  return headers->count(included) > 0 || included.rfind("grpcpp/", 0) == 0 ||
         included.find(".grpc.pb.h") != std::string::npos;
}

const Room* RoomOf(const std::string& path) {
  const Room* best = nullptr;
  std::size_t longest = 0;
  for (const Room& room : Rooms()) {
    for (const std::string& prefix : room.prefixes) {
      if (path.rfind(prefix, 0) == 0 && prefix.size() > longest) {
        longest = prefix.size();
        best = &room;
      }
    }
  }
  return best;
}

bool IsMain(const std::string& path) {
  return std::filesystem::path(path).filename() == "main.cc";
}

std::string Describe(const Room& room) {
  return room.name + ", floor " + std::to_string(room.floor);
}

// Why the file at `path` may not include `included`; "" where it may.
std::string Violation(const std::string& path, const std::string& included) {
  if (IsMain(path)) return "";
  const Room* from = RoomOf(path);
  if (from == nullptr) return path + " belongs to no room";
  if (from->name == "algorithms" && IsOutsideWorld(included)) {
    return path + " (" + Describe(*from) + ") includes " + included + ": no network, clock or file there";
  }
  if (from->floor <= 1 && from->name != "wire" && included.rfind("grpcpp/", 0) == 0) {
    return path + " (" + Describe(*from) + ") includes " + included + ": no gRPC there";
  }
  const Room* to = RoomOf(included);
  if (included.rfind("tests/", 0) == 0) return path + " includes " + included + ": tests are above all rooms";
  if (to == nullptr || to == from || to->floor < from->floor) return "";
  return path + " (" + Describe(*from) + ") includes " + included + " (" + Describe(*to) +
         "): a room includes only from floors below (rooms are listed in this test)";
}

// The "path" or <path> of every line that begins with #include.
std::vector<std::string> IncludesOf(const std::filesystem::path& file) {
  const std::string directive = "#include ";
  std::vector<std::string> includes;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t end = line.find_first_of("\">", directive.size() + 1);
    if (line.rfind(directive, 0) != 0 || end == std::string::npos) continue;
    includes.push_back(line.substr(directive.size() + 1, end - directive.size() - 1));
  }
  return includes;
}

TEST(FloorsTest, EverySourceIncludesOnlyFromFloorsBelow) {
  const std::filesystem::path root = DBR_SOURCE_DIR;
  int files = 0, includes = 0;
  for (const char* folder : {"core", "proto", "nn", "envs", "replay", "learner", "actor", "deploy"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      const auto extension = entry.path().extension();
      if (extension != ".h" && extension != ".cc") continue;
      const std::string path = entry.path().lexically_relative(root).generic_string();
      ++files;
      for (const std::string& included : IncludesOf(entry.path())) {
        ++includes;
        EXPECT_EQ(Violation(path, included), "");
      }
    }
  }
  EXPECT_GT(includes, 2 * files);
  EXPECT_GT(files, 50) << "the sources were not found under " << root;
}

TEST(FloorsTest, FindsEachKindOfViolation) {
  using testing::HasSubstr;
  EXPECT_THAT(Violation("core/rng.h", "nn/mlp.h"), HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("nn/mlp.cc", "envs/env.h"), HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("replay/buffer/partitioned_buffer.cc", "proto/rpc/codec.h"),
              HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("replay/store/writer_table.h", "replay/service/service.h"),
              HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("replay/buffer/selectors/uniform.cc", "grpcpp/grpcpp.h"), HasSubstr("no gRPC"));
  EXPECT_THAT(Violation("learner/algorithms/discrete_dbr.cc", "learner/runtime/trainer.h"),
              HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("learner/training/twin_critic.h", "replay/client/client.h"),
              HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("learner/algorithm.h", "absl/time/clock.h"), HasSubstr("no network, clock or file"));
  EXPECT_THAT(Violation("actor/step_loop.cc", "learner/runtime/trainer.h"),
              HasSubstr("only from floors below"));
  EXPECT_THAT(Violation("core/rng.h", "tests/support/temp_dir.h"), HasSubstr("tests are above"));
  EXPECT_THAT(Violation("elsewhere/file.cc", "core/rng.h"), HasSubstr("no room"));
}

TEST(FloorsTest, AllowsWhatTheHouseAllows) {
  EXPECT_EQ(Violation("learner/algorithms/discrete_dbr.cc", "proto/config.pb.h"), "");
  EXPECT_EQ(Violation("learner/algorithms/discrete_dbr.cc", "nn/mlp.h"), "");
  EXPECT_EQ(Violation("replay/service/service.cc", "replay/buffer/partitioned_buffer.h"), "");
  EXPECT_EQ(Violation("replay/client/writer.cc", "proto/rpc/codec.h"), "");
  EXPECT_EQ(Violation("actor/step_loop.cc", "replay/client/writer.h"), "");
  EXPECT_EQ(Violation("learner/runtime/trainer.cc", "learner/algorithm.h"), "");
  EXPECT_EQ(Violation("learner/runtime/main.cc", "learner/runtime/trainer.h"), "");
  EXPECT_EQ(Violation("core/file_io.cc", "fcntl.h"), "");
}

}  // namespace
}  // namespace dbr
