// How a robot is built: limbs, joints and torques, as its model file says. Model files are read in single
// precision, so lengths and angles are floats here, and Bullet widens them: 0.05f is 0.05000000074505806.
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

// An angle in radians, from degrees, rounded as the model files' reader rounds it.
constexpr float Degrees(float degrees) {
  return degrees * kPi / 180.0f;
}

// Shapes, in the frame of their part; radii and lengths in m.
//
// A capsule given by its two ends: collides as the convex hull of two spheres.
struct Bone {
  Vec3 from;
  Vec3 to;
  float radius = 0;
};
// A capsule given by its size, standing on its middle, leant forward by `tilt` about the axis to the left.
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

// A rigid part, hung on its parent at `pivot`. Without a hinge it is welded to it.
struct Part {
  std::string name{};
  std::string parent{};  // a part named before; empty for the torso
  Vec3 position{};       // of this part's frame in its parent's frame
  Vec3 pivot{};          // of its joint, in its own frame
  std::optional<Hinge> hinge{};
  std::vector<Shape> shapes{};
  double mass_kg = 0;     // 0: that of its volume at 1,000 kg/m3
  bool far_side = false;  // seen from the side, it is behind; of no weight to the simulation
};

// How the torso hangs in the world: it slides forward and up and turns about the axis to the left, or it is
// free.
enum class Root { kPlanar, kFree };

struct BodyPlan {
  Root root = Root::kPlanar;
  float friction = 0;
  bool parts_collide = false;  // with each other, but for a part and its ancestors
  std::vector<Part> parts{};   // the torso first, then every part after its parent
};

}  // namespace dbr::bullet
