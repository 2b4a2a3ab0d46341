// The table of docs/rooms.txt: which folder of the sources may include from which, and the picture of it.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace dbr {

struct Room {
  std::string folder;
  std::set<std::string> may_include;  // folders, and the words "grpc", "files", "clock" and "date"
  std::string purpose;
};

// The rooms by their folders.
using Rooms = std::map<std::string, Room>;

// Reads the table. Each line that cannot be read, names a folder twice or allows what has no line of its own
// is described in `errors`.
Rooms ParseRooms(const std::string& text, std::vector<std::string>* errors);

// The folders of a circle of rooms that include each other, "a -> b -> a"; "" where there is none.
std::string FindCircle(const Rooms& rooms);

// The word that stands for an included header of the outside world ("grpc", "files", "clock" or "date"); ""
// for every other header.
std::string OutsideWorld(const std::string& included);

// Why the file at `path` may not include `included`; "" where it may.
std::string Violation(const Rooms& rooms, const std::string& path, const std::string& included);

// The floor of each room: 0 where it includes from no other, else one above the highest that it includes
// from. Requires that there is no circle.
std::map<std::string, int> FloorsOf(const Rooms& rooms);

// An SVG in which each room stands on its floor, in the column of its folder at the top of the tree, with an
// arrow to each room that it includes from and that no other arrow leads to already. Requires that there is
// no circle.
std::string DrawRooms(const Rooms& rooms);

}  // namespace dbr
