#include "envs/bullet/hopper.h"

#include <cmath>

namespace dbr::bullet {
namespace {

bool Stands(const Stance& stance) {
  return stance.height_m > 0.8 && std::abs(stance.pitch_rad) < 1.0;
}

// A hinge that bends backward.
Hinge Bends(float lower_degrees, float upper_degrees) {
  return {.axis = {0, -1, 0},
          .lower_rad = Degrees(lower_degrees),
          .upper_rad = Degrees(upper_degrees),
          .torque_nm = 75};
}

}  // namespace

// All frames are the world's frame, at the robot's feet. Heights are above the floor.
RobotPlan HopperPlan() {
  return {.body = {.root = Root::kPlanar,
                   .friction = 0.8f,
                   .parts_collide = true,
                   .parts = {{.name = "torso", .shapes = {Bone{{0, 0, 1.45f}, {0, 0, 1.05f}, 0.05f}}},
                             {.name = "thigh",
                              .parent = "torso",
                              .pivot = {0, 0, 1.05f},
                              .hinge = Bends(-150, 0),
                              .shapes = {Bone{{0, 0, 1.05f}, {0, 0, 0.6f}, 0.05f}}},
                             {.name = "leg",
                              .parent = "thigh",
                              .pivot = {0, 0, 0.6f},
                              .hinge = Bends(-150, 0),
                              .shapes = {Bone{{0, 0, 0.6f}, {0, 0, 0.1f}, 0.04f}}},
                             {.name = "foot",
                              .parent = "leg",
                              .pivot = {0, 0, 0.1f},
                              .hinge = Bends(-45, 45),
                              .shapes = {Bone{{-0.13f, 0, 0.1f}, {0.26f, 0, 0.1f}, 0.06f}}}}},
          .feet = {"foot"},
          .stands = Stands};
}

}  // namespace dbr::bullet
