// How a robot is built: limbs, joints and torques, as in its model file. PyBullet reads model files in single
// precision, so lengths and angles are floats here and Bullet widens them: 0.05f is 0.05000000074505806.
// Plain values.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace dbr::bullet {

// A point or direction: forward, left, up (m).
struct Vec3 {
  float x = 0;
  float y = 0;
  float z = 0;
};

constexpr float kPi = 3.14159274f;

// Converts degrees to radians, with the rounding of the model files' reader.
constexpr float Degrees(float degrees) {
  return degrees * kPi / 180.0f;
}

// Shapes in the frame of their part. Radii and lengths are in m.
//
// A capsule given by its two ends. It collides as the convex hull of two spheres.
struct Bone {
  Vec3 from;
  Vec3 to;
  float radius = 0;
};
// A capsule given by its size and the place of its middle. It stands upright and leans forward by `tilt_rad`
// about the axis to the left.
struct Rod {
  Vec3 middle;
  float tilt_rad = 0;
  float radius = 0;
  float length = 0;  // without the caps
};
struct Ball {
  float radius = 0;
};
using Shape = std::variant<Bone, Rod, Ball>;

// A joint that turns about an axis between two limits, driven by a torque.
struct Hinge {
  Vec3 axis{};  // not normalised: the ant's ankles have axes of length sqrt(2)
  float lower_rad = 0;
  float upper_rad = 0;
  double torque_nm = 0;  // at action 1
};

// A rigid part that hangs on its parent at `pivot`. Without a hinge it is welded to the parent.
struct Part {
  std::string name{};
  std::string parent{};  // an earlier part; empty for the torso
  Vec3 position{};       // the place of this part's frame in its parent's frame
  Vec3 pivot{};          // the place of its joint in its own frame
  std::optional<Hinge> hinge{};
  std::vector<Shape> shapes{};
  double mass_kg = 0;     // 0 means the mass of its volume at 1,000 kg/m3
  bool far_side = false;  // for drawing alone: it is behind in the view from the side
};

// How the torso moves in the world. kPlanar: it slides forward and up and turns about the axis to the left.
// kFree: it moves freely.
enum class Root { kPlanar, kFree };

struct BodyPlan {
  Root root = Root::kPlanar;
  float friction = 0;
  bool parts_collide = false;  // with each other, except a part with its ancestors
  std::vector<Part> parts{};   // the torso first, then every part after its parent
};

}  // namespace dbr::bullet
