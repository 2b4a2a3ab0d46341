// Describes how an environment looks at one moment: enough to draw it.
#pragma once

#include <vector>

namespace dbr {

// A point: forward, left and up, in m.
struct Point {
  double x = 0;
  double y = 0;
  double z = 0;
};

// A capsule. It is a ball where both ends are the same point.
struct Limb {
  Point from;
  Point to;
  double radius_m = 0;
  int rank = 0;           // 0 for the trunk, 1 for the limbs on the trunk, and so on
  bool far_side = false;  // in the view from the side it is behind all others
};

// The best view of a figure: from the side for one that moves in a plane, from a corner above for others.
enum class View { kSide, kSlant };

// The floor is at height 0.
struct Figure {
  View view = View::kSide;
  std::vector<Limb> limbs;
  std::vector<Point> joints;
  Point place;           // where the trunk is
  double speed_m_s = 0;  // forward
  double seconds_a_step = 0;
};

}  // namespace dbr
