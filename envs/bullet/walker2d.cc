#include "envs/bullet/walker2d.h"

#include <cmath>
#include <string>

namespace dbr::bullet {
namespace {

constexpr double kLegTorque = 40;   // Nm, hips and knees
constexpr double kFootTorque = 12;  // Nm

bool Stands(const Stance& stance) {
  return stance.height_m > 0.8 && std::abs(stance.pitch_rad) < 1.0;
}

Hinge Bend(float lower_degrees, float upper_degrees, double torque_nm) {
  return {.axis = {0, -1, 0},
          .lower_rad = Degrees(lower_degrees),
          .upper_rad = Degrees(upper_degrees),
          .torque_nm = torque_nm};
}

// Adds a leg's parts. `side` is the end of the left leg's names and empty for the right leg. Heights are
// above the floor.
void AddLeg(const std::string& side, std::vector<Part>& parts) {
  const bool far_side = !side.empty();  // in the view from the right the left leg is behind
  parts.push_back({.name = "thigh" + side,
                   .parent = "torso",
                   .pivot = {0, 0, 1.05f},
                   .hinge = Bend(-150, 0, kLegTorque),
                   .shapes = {Bone{{0, 0, 1.05f}, {0, 0, 0.6f}, 0.05f}},
                   .far_side = far_side});
  parts.push_back({.name = "leg" + side,
                   .parent = "thigh" + side,
                   .pivot = {0, 0, 0.6f},
                   .hinge = Bend(-150, 0, kLegTorque),
                   .shapes = {Bone{{0, 0, 0.6f}, {0, 0, 0.1f}, 0.04f}},
                   .far_side = far_side});
  parts.push_back({.name = "foot" + side,
                   .parent = "leg" + side,
                   .pivot = {0, 0, 0.1f},
                   .hinge = Bend(-45, 45, kFootTorque),
                   .shapes = {Bone{{0, 0, 0.1f}, {0.2f, 0, 0.1f}, 0.06f}},
                   .far_side = far_side});
}

}  // namespace

RobotPlan Walker2dPlan() {
  RobotPlan plan;
  plan.body.root = Root::kPlanar;
  plan.body.friction = 0.8f;
  plan.body.parts.push_back({.name = "torso", .shapes = {Bone{{0, 0, 1.45f}, {0, 0, 1.05f}, 0.05f}}});
  AddLeg("", plan.body.parts);
  AddLeg("_left", plan.body.parts);
  plan.feet = {"foot", "foot_left"};
  plan.stands = Stands;
  return plan;
}

}  // namespace dbr::bullet
