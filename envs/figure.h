// What an environment looks like at a moment: enough to draw it, and no more.
#pragma once

#include <vector>

namespace dbr {

// Forward, left and up (m).
struct Point {
  double x = 0;
  double y = 0;
  double z = 0;
};

// A capsule; a ball where both ends are one.
struct Limb {
  Point from;
  Point to;
  double radius_m = 0;
  int rank = 0;           // 0: the trunk, 1: what hangs on it, and so on
  bool far_side = false;  // seen from the side, it is behind all others
};

// From where a figure is seen best: one that moves in a plane from its side, others from a corner above.
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
