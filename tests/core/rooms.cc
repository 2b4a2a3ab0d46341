#include "tests/core/rooms.h"

#include <algorithm>
#include <filesystem>
#include <sstream>

namespace dbr {
namespace {

const std::set<std::string>& Words() {
  static const auto* words = new std::set<std::string>{"grpc", "files", "clock", "date"};
  return *words;
}

std::string Trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

std::vector<std::string> Split(const std::string& line, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(line);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(Trimmed(part));
  return parts;
}

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::string FolderOf(const std::string& path) {
  return std::filesystem::path(path).parent_path().generic_string();
}

// Walks from `folder` downwards; `trail` holds the rooms above it.
std::string CircleThrough(const Rooms& rooms, const std::string& folder, std::vector<std::string>* trail,
                          std::set<std::string>* without_circle) {
  if (without_circle->count(folder) > 0) return "";
  const auto seen = std::find(trail->begin(), trail->end(), folder);
  if (seen != trail->end()) {
    std::string circle;
    for (auto it = seen; it != trail->end(); ++it) circle += *it + " -> ";
    return circle + folder;
  }
  trail->push_back(folder);
  for (const std::string& below : rooms.at(folder).may_include) {
    if (rooms.count(below) == 0) continue;
    if (const std::string circle = CircleThrough(rooms, below, trail, without_circle); !circle.empty())
      return circle;
  }
  trail->pop_back();
  without_circle->insert(folder);
  return "";
}

}  // namespace

Rooms ParseRooms(const std::string& text, std::vector<std::string>* errors) {
  Rooms rooms;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (Trimmed(line).empty() || line[0] == '#') continue;
    const std::vector<std::string> parts = Split(line, '|');
    if (parts.size() != 3 || parts[0].empty() || parts[2].empty()) {
      errors->push_back("expected 'FOLDER | what it may include | what lives there', found '" + line + "'");
      continue;
    }
    Room room{.folder = parts[0], .may_include = {}, .purpose = parts[2]};
    for (const std::string& allowed : Split(parts[1], ' ')) {
      if (!allowed.empty()) room.may_include.insert(allowed);
    }
    if (!rooms.emplace(room.folder, room).second) errors->push_back(room.folder + " has two lines");
  }
  for (const auto& [folder, room] : rooms) {
    for (const std::string& allowed : room.may_include) {
      if (rooms.count(allowed) == 0 && Words().count(allowed) == 0)
        errors->push_back(folder + " may include " + allowed + ", which has no line");
    }
  }
  return rooms;
}

std::string FindCircle(const Rooms& rooms) {
  std::set<std::string> without_circle;
  for (const auto& [folder, room] : rooms) {
    std::vector<std::string> trail;
    if (const std::string circle = CircleThrough(rooms, folder, &trail, &without_circle); !circle.empty())
      return circle;
  }
  return "";
}

std::string OutsideWorld(const std::string& included) {
  static const auto* words = new std::map<std::string, std::string>{{"absl/time/clock.h", "date"},
                                                                    {"chrono", "clock"},
                                                                    {"ctime", "date"},
                                                                    {"core/file_io.h", "files"},
                                                                    {"core/monotonic_clock.h", "clock"},
                                                                    {"core/stop_flag.h", "clock"},
                                                                    {"core/run_folder.h", "files"},
                                                                    {"core/shutdown.h", "files"},
                                                                    {"fcntl.h", "files"},
                                                                    {"filesystem", "files"},
                                                                    {"fstream", "files"},
                                                                    {"hdf5.h", "files"},
                                                                    {"sys/mman.h", "files"},
                                                                    {"sys/stat.h", "files"},
                                                                    {"unistd.h", "files"}};
  if (included.rfind("grpcpp/", 0) == 0 || EndsWith(included, ".grpc.pb.h")) return "grpc";
  const auto it = words->find(included);
  return it == words->end() ? "" : it->second;
}

std::string Violation(const Rooms& rooms, const std::string& path, const std::string& included) {
  if (included.rfind("tests/", 0) == 0) return path + " includes " + included + ": tests are above all rooms";
  if (std::filesystem::path(path).filename() == "main.cc") return "";
  const std::string folder = FolderOf(path), other = FolderOf(included);
  const auto room = rooms.find(folder);
  if (room == rooms.end()) return path + ": docs/rooms.txt has no line for " + folder;
  const std::string rule = "; docs/rooms.txt lists what " + folder + " may include";
  const std::string word = OutsideWorld(included);
  if (!word.empty() && room->second.may_include.count(word) == 0)
    return path + " includes " + included + ": no " + word + " there" + rule;
  if (other == folder || rooms.count(other) == 0 || room->second.may_include.count(other) > 0) return "";
  return path + " includes " + included + ": nothing of " + other + " there" + rule;
}

std::map<std::string, int> FloorsOf(const Rooms& rooms) {
  std::map<std::string, int> floors;
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& [folder, room] : rooms) {
      int floor = 0;
      for (const std::string& below : room.may_include) {
        if (rooms.count(below) > 0) floor = std::max(floor, floors[below] + 1);
      }
      changed = changed || floors[folder] != floor;
      floors[folder] = floor;
    }
  }
  return floors;
}

}  // namespace dbr
