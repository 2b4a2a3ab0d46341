// Draws the rooms as an SVG.
#include <algorithm>
#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/core/rooms.h"

namespace dbr {
namespace {

constexpr int kBoxWidth = 140, kBoxHeight = 30, kGap = 14, kFloorHeight = 78, kLeft = 64, kTop = 34;

struct Box {
  int x = 0, y = 0;
};

std::string TopOf(const std::string& folder) {
  return folder.substr(0, folder.find('/'));
}

// All rooms below one, however many steps down.
void AddBelow(const Rooms& rooms, const std::string& folder, std::set<std::string>* below) {
  for (const std::string& next : rooms.at(folder).may_include) {
    if (rooms.count(next) > 0 && below->insert(next).second) AddBelow(rooms, next, below);
  }
}

// What `folder` includes from and reaches by no other room.
std::vector<std::string> DirectlyBelow(const Rooms& rooms, const std::string& folder) {
  std::set<std::string> by_others;
  for (const std::string& next : rooms.at(folder).may_include) {
    if (rooms.count(next) > 0) AddBelow(rooms, next, &by_others);
  }
  std::vector<std::string> direct;
  for (const std::string& next : rooms.at(folder).may_include) {
    if (rooms.count(next) > 0 && by_others.count(next) == 0) direct.push_back(next);
  }
  return direct;
}

// The folders at the top of the tree, from the lowest floor upwards.
std::vector<std::string> Columns(const Rooms& rooms, const std::map<std::string, int>& floors) {
  std::map<std::string, int> highest;
  for (const auto& [folder, room] : rooms)
    highest[TopOf(folder)] = std::max(highest[TopOf(folder)], floors.at(folder));
  std::vector<std::string> columns;
  for (const auto& [top, floor] : highest) columns.push_back(top);
  std::stable_sort(columns.begin(), columns.end(),
                   [&](const std::string& a, const std::string& b) { return highest.at(a) < highest.at(b); });
  return columns;
}

// Where each room stands; the picture's width in `width`.
std::map<std::string, Box> Place(const Rooms& rooms, const std::map<std::string, int>& floors, int top_floor,
                                 int* width) {
  std::map<std::string, Box> boxes;
  int left = kLeft;
  for (const std::string& column : Columns(rooms, floors)) {
    std::map<int, std::vector<std::string>> by_floor;
    std::size_t most = 1;
    for (const auto& [folder, room] : rooms) {
      if (TopOf(folder) != column) continue;
      by_floor[floors.at(folder)].push_back(folder);
      most = std::max(most, by_floor[floors.at(folder)].size());
    }
    const int column_width = static_cast<int>(most) * (kBoxWidth + kGap) + kGap;
    for (const auto& [floor, folders] : by_floor) {
      const int count = static_cast<int>(folders.size());
      int x = left + (column_width - count * kBoxWidth - (count - 1) * kGap) / 2;
      for (const std::string& folder : folders) {
        boxes[folder] = {x, kTop + (top_floor - floor) * kFloorHeight + (kFloorHeight - kBoxHeight) / 2};
        x += kBoxWidth + kGap;
      }
    }
    left += column_width;
  }
  *width = left + kGap;
  return boxes;
}

std::string Format(const char* format, auto... values) {
  char text[512];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

// Text as it may stand in XML.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '>')
      escaped += "&gt;";
    else
      escaped += c;
  }
  return escaped;
}

std::string Arrow(const std::string& from, const Box& a, const std::string& to, const Box& b) {
  const int x1 = a.x + kBoxWidth / 2, y1 = a.y + kBoxHeight, x2 = b.x + kBoxWidth / 2, y2 = b.y - 3;
  const int bend = std::max(18, (y2 - y1) / 2);
  return Format("<path class=\"%s\" d=\"M%d %dC%d %d %d %d %d %d\" marker-end=\"url(#tip)\"><title>",
                TopOf(from).c_str(), x1, y1, x1, y1 + bend, x2, y2 - bend, x2, y2) +
         Escaped(from + " -> " + to) + "</title></path>\n";
}

// Colours for the light and for the dark screen; each column's boxes and arrows have one of their own.
std::string Style(const std::vector<std::string>& columns) {
  std::string style =
      "text{font:13px system-ui,sans-serif;fill:#1c2127;text-anchor:middle}"
      ".floor{font-size:11px;fill:#6b7280;text-anchor:start}.band{fill:#f3f4f6}rect{rx:5}"
      "path{fill:none;stroke-width:1.3;opacity:.75}";
  std::string dark = "text{fill:#e6e8eb}.floor{fill:#9aa3ad}.band{fill:#1b2027}svg{background:#12161b}";
  int i = 0;
  for (const std::string& column : columns) {
    const int hue = (210 + 47 * i++) % 360;
    style +=
        Format("rect.%s{fill:hsl(%d,62%%,86%%);stroke:hsl(%d,45%%,45%%)}path.%s{stroke:hsl(%d,45%%,45%%)}",
               column.c_str(), hue, hue, column.c_str(), hue);
    dark += Format("rect.%s{fill:hsl(%d,38%%,26%%)}", column.c_str(), hue);
  }
  return "<style>" + style + "@media(prefers-color-scheme:dark){" + dark + "}</style>\n";
}

}  // namespace

std::string DrawRooms(const Rooms& rooms) {
  const std::map<std::string, int> floors = FloorsOf(rooms);
  int top_floor = 0, width = 0;
  for (const auto& [folder, floor] : floors) top_floor = std::max(top_floor, floor);
  const std::map<std::string, Box> boxes = Place(rooms, floors, top_floor, &width);
  const int height = kTop + (top_floor + 1) * kFloorHeight + kGap;

  std::string svg =
      Format(
          "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" role=\"img\" "
          "aria-label=\"The folders of the sources by floor; each arrow leads to a folder that is "
          "included\">\n",
          width, height) +
      Style(Columns(rooms, floors)) +
      "<defs><marker id=\"tip\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"6\" "
      "markerHeight=\"6\" "
      "orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" style=\"fill:#6b7280;opacity:1\"/></marker></defs>\n";
  for (int floor = 0; floor <= top_floor; ++floor) {
    const int y = kTop + (top_floor - floor) * kFloorHeight;
    if (floor % 2 == 0)
      svg += Format("<rect class=\"band\" x=\"0\" y=\"%d\" width=\"%d\" height=\"%d\"/>\n", y, width,
                    kFloorHeight);
    svg +=
        Format("<text class=\"floor\" x=\"10\" y=\"%d\">floor %d</text>\n", y + kFloorHeight / 2 + 4, floor);
  }
  for (const auto& [folder, room] : rooms) {
    for (const std::string& below : DirectlyBelow(rooms, folder))
      svg += Arrow(folder, boxes.at(folder), below, boxes.at(below));
  }
  for (const auto& [folder, box] : boxes) {
    svg += Format("<g><title>%s</title><rect class=\"%s\" x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\"/>",
                  Escaped(rooms.at(folder).purpose).c_str(), TopOf(folder).c_str(), box.x, box.y, kBoxWidth,
                  kBoxHeight);
    svg += Format("<text x=\"%d\" y=\"%d\">%s</text></g>\n", box.x + kBoxWidth / 2,
                  box.y + kBoxHeight / 2 + 4, folder.c_str());
  }
  return svg + "</svg>\n";
}

}  // namespace dbr
