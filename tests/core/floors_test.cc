// The floors of the house: docs/rooms.txt has a line a folder with what it may include, and the sources keep
// to it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/core/rooms.h"

namespace dbr {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::size_t kMostSources = 30;  // of one folder, a .cc with its .h counted once

std::filesystem::path Root() {
  return DBR_SOURCE_DIR;
}

std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::stringstream text;
  text << stream.rdbuf();
  return text.str();
}

Rooms TheRooms() {
  std::vector<std::string> errors;
  Rooms rooms = ParseRooms(ReadAll(Root() / "docs/rooms.txt"), &errors);
  EXPECT_THAT(errors, IsEmpty());
  return rooms;
}

// The sources, by paths from the root.
std::vector<std::string> Sources() {
  std::vector<std::string> paths;
  for (const char* top : {"core", "proto", "nn", "envs", "replay", "learner", "actor", "deploy"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(Root() / top)) {
      const auto extension = entry.path().extension();
      if (extension == ".h" || extension == ".cc")
        paths.push_back(entry.path().lexically_relative(Root()).generic_string());
    }
  }
  EXPECT_GT(paths.size(), 200) << "the sources were not found under " << Root();
  return paths;
}

// The "path" or <path> of every line that begins with #include.
std::vector<std::string> IncludesOf(const std::string& path) {
  const std::string directive = "#include ";
  std::vector<std::string> includes;
  std::ifstream stream(Root() / path);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t end = line.find_first_of("\">", directive.size() + 1);
    if (line.rfind(directive, 0) != 0 || end == std::string::npos) continue;
    includes.push_back(line.substr(directive.size() + 1, end - directive.size() - 1));
  }
  return includes;
}

TEST(FloorsTest, EverySourceIncludesOnlyWhatItsFolderMay) {
  const Rooms rooms = TheRooms();
  std::size_t includes = 0;
  for (const std::string& path : Sources()) {
    for (const std::string& included : IncludesOf(path)) {
      ++includes;
      EXPECT_EQ(Violation(rooms, path, included), "");
    }
  }
  EXPECT_GT(includes, 400);
}

TEST(FloorsTest, NoFoldersIncludeEachOtherInACircle) {
  EXPECT_EQ(FindCircle(TheRooms()), "");
}

TEST(FloorsTest, EveryFolderHasALineAndEveryLineAFolder) {
  const Rooms rooms = TheRooms();
  std::set<std::string> folders = {"proto"};  // holds schemas alone
  for (const std::string& path : Sources())
    folders.insert(std::filesystem::path(path).parent_path().generic_string());
  for (const auto& [folder, room] : rooms) EXPECT_EQ(folders.count(folder), 1) << folder << " has no sources";
  for (const std::string& folder : folders) EXPECT_EQ(rooms.count(folder), 1) << folder << " has no line";
}

// A folder may include what is listed because some file of it does.
TEST(FloorsTest, EveryLineAllowsOnlyWhatIsUsed) {
  std::map<std::string, std::set<std::string>> used;
  for (const std::string& path : Sources()) {
    if (std::filesystem::path(path).filename() == "main.cc") continue;
    std::set<std::string>& of_folder = used[std::filesystem::path(path).parent_path().generic_string()];
    for (const std::string& included : IncludesOf(path)) {
      of_folder.insert(std::filesystem::path(included).parent_path().generic_string());
      of_folder.insert(OutsideWorld(included));
    }
  }
  used["proto"].insert("grpc");  // the generated services
  for (const auto& [folder, room] : TheRooms()) {
    for (const std::string& allowed : room.may_include)
      EXPECT_EQ(used[folder].count(allowed), 1) << folder << " may include " << allowed << " and does not";
  }
}

TEST(FloorsTest, NoFolderHoldsMoreThanAFewDozenSources) {
  std::map<std::string, std::set<std::string>> units;
  for (const std::string& path : Sources()) {
    const std::filesystem::path source(path);
    units[source.parent_path().generic_string()].insert(source.stem().string());
  }
  for (const auto& [folder, names] : units) EXPECT_LE(names.size(), kMostSources) << folder;
}

// To draw it anew: DBR_UPDATE_DOCS=1 build/tests/floors_test
TEST(FloorsTest, ThePictureInTheDocsIsOfThisTable) {
  const std::filesystem::path path = Root() / "docs/pictures/rooms.svg";
  const std::string picture = DrawRooms(TheRooms());
  if (std::getenv("DBR_UPDATE_DOCS") != nullptr) std::ofstream(path) << picture;
  EXPECT_TRUE(ReadAll(path) == picture)
      << path << " is not what docs/rooms.txt says; draw it anew: DBR_UPDATE_DOCS=1 build/tests/floors_test";
}

Rooms Small() {
  std::vector<std::string> errors;
  Rooms rooms = ParseRooms(
      "# a comment\n\n"
      "core | files | values\n"
      "nn | core | networks\n"
      "envs | core | worlds\n"
      "actor | core nn envs grpc clock | acting\n",
      &errors);
  EXPECT_THAT(errors, IsEmpty());
  return rooms;
}

TEST(RoomsTest, FindsEachKindOfViolation) {
  const Rooms rooms = Small();
  EXPECT_THAT(Violation(rooms, "core/rng.h", "nn/mlp.h"), HasSubstr("nothing of nn there"));
  EXPECT_THAT(Violation(rooms, "nn/mlp.cc", "envs/env.h"), HasSubstr("nothing of envs there"));
  EXPECT_THAT(Violation(rooms, "nn/mlp.cc", "grpcpp/grpcpp.h"), HasSubstr("no grpc there"));
  EXPECT_THAT(Violation(rooms, "nn/mlp.cc", "proto/replay.grpc.pb.h"), HasSubstr("no grpc there"));
  EXPECT_THAT(Violation(rooms, "envs/env.cc", "core/monotonic_clock.h"), HasSubstr("no clock there"));
  EXPECT_THAT(Violation(rooms, "actor/step_loop.cc", "core/file_io.h"), HasSubstr("no files there"));
  EXPECT_THAT(Violation(rooms, "core/rng.h", "tests/support/temp_dir.h"), HasSubstr("tests are above"));
  EXPECT_THAT(Violation(rooms, "elsewhere/file.cc", "core/rng.h"), HasSubstr("no line for elsewhere"));
  EXPECT_THAT(Violation(rooms, "nn/deeper/file.cc", "core/rng.h"), HasSubstr("no line for nn/deeper"));
}

TEST(RoomsTest, AllowsWhatTheTableAllows) {
  const Rooms rooms = Small();
  EXPECT_EQ(Violation(rooms, "nn/mlp.cc", "core/rng.h"), "");
  EXPECT_EQ(Violation(rooms, "nn/mlp.cc", "nn/product.h"), "");
  EXPECT_EQ(Violation(rooms, "nn/mlp.cc", "vector"), "");
  EXPECT_EQ(Violation(rooms, "actor/step_loop.cc", "grpcpp/grpcpp.h"), "");
  EXPECT_EQ(Violation(rooms, "core/file_io.cc", "fcntl.h"), "");
  EXPECT_EQ(Violation(rooms, "core/main.cc", "actor/actor.h"), "");
}

TEST(RoomsTest, FindsACircleAndNamesItsFolders) {
  std::vector<std::string> errors;
  const Rooms rooms = ParseRooms("a | b | one\nb | c | two\nc | d b | three\nd | | four\n", &errors);
  EXPECT_THAT(errors, IsEmpty());
  EXPECT_EQ(FindCircle(rooms), "b -> c -> b");
  EXPECT_EQ(FindCircle(Small()), "");
}

TEST(RoomsTest, DescribesEachLineThatItCannotRead) {
  std::vector<std::string> errors;
  ParseRooms("core | files\nnn | cores | networks\nnn | | networks\n", &errors);
  EXPECT_THAT(errors, testing::ElementsAre(HasSubstr("found 'core | files'"), HasSubstr("nn has two lines"),
                                           HasSubstr("cores, which has no line")));
}

TEST(RoomsTest, ARoomStandsAboveAllThatItIncludes) {
  EXPECT_THAT(FloorsOf(Small()),
              testing::UnorderedElementsAre(testing::Pair("core", 0), testing::Pair("nn", 1),
                                            testing::Pair("envs", 1), testing::Pair("actor", 2)));
}

TEST(RoomsTest, DrawsEachRoomAndLeavesOutArrowsThatFollowFromOthers) {
  const std::string picture = DrawRooms(Small());
  for (const char* folder : {"core", "nn", "envs", "actor"}) EXPECT_THAT(picture, HasSubstr(folder));
  EXPECT_THAT(picture, HasSubstr("actor -&gt; nn"));
  EXPECT_THAT(picture, testing::Not(HasSubstr("actor -&gt; core")));
}

// The time of day may be set while a program runs; a wait or a deadline that goes by it then ends at once, or
// hours late. absl::Now() is for labels, and its header is for the folders that the table allows it in.
TEST(ClockTest, NoWaitAndNoDeadlineGoesByTheTimeOfDay) {
  for (const std::string& path : Sources()) {
    const std::string text = ReadAll(Root() / path);
    for (const char* word :
         {"AwaitWithTimeout(", "AwaitWithDeadline(", "LockWhenWith", "WaitForNotificationWith",
          "WaitWithTimeout(", "WaitWithDeadline(", "SleepFor(", "system_clock", "ToChronoTime("}) {
      if (path == "core/monotonic_clock.h") continue;  // says what it stands for
      EXPECT_EQ(text.find(word), std::string::npos)
          << path << " has " << word << ": use core/monotonic_clock.h, or proto/rpc/deadline.h for a call";
    }
  }
}

}  // namespace
}  // namespace dbr
