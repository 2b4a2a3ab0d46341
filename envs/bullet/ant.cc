#include "envs/bullet/ant.h"

#include <string>

namespace dbr::bullet {
namespace {

constexpr float kRadius = 0.08f;  // m, a leg's
constexpr float kReach = 0.2f;    // m from joint to joint, forward and sideways
constexpr double kTorque = 250;   // Nm

bool Stands(const Stance& stance) {
  return stance.height_m > 0.26;
}

// The direction of a leg: forward or back, left or right. Each value is 1 or -1.
struct Corner {
  float forward;
  float left;
};

Vec3 Towards(const Corner& corner, float reach) {
  return {corner.forward * reach, corner.left * reach, 0};
}

// The foot turns about the level axis across the leg. A leg and the opposite one have the same axis, so that
// a positive turn bends one of them down and the other up. The limits keep every foot pointing down.
Hinge Ankle(const Corner& corner) {
  const bool positive_is_down = corner.forward > 0;
  return {.axis = {corner.forward == corner.left ? -1.0f : 1.0f, 1, 0},
          .lower_rad = positive_is_down ? Degrees(30) : Degrees(-100),
          .upper_rad = positive_is_down ? Degrees(100) : Degrees(-30),
          .torque_nm = kTorque};
}

// A leg is welded to the torso; the next piece, `aux`, turns sideways at the hip, and the foot up and down.
void AddLeg(const Corner& corner, const std::string& leg, const std::string& aux, const std::string& foot,
            std::vector<Part>& parts) {
  const Vec3 joint = Towards(corner, kReach);
  parts.push_back({.name = leg, .parent = "torso", .shapes = {Bone{{0, 0, 0}, joint, kRadius}}});
  parts.push_back(
      {.name = aux,
       .parent = leg,
       .position = joint,
       .hinge =
           Hinge{
               .axis = {0, 0, 1}, .lower_rad = Degrees(-40), .upper_rad = Degrees(40), .torque_nm = kTorque},
       .shapes = {Bone{{0, 0, 0}, joint, kRadius}}});
  parts.push_back({.name = foot,
                   .parent = aux,
                   .position = joint,
                   .hinge = Ankle(corner),
                   .shapes = {Bone{{0, 0, 0}, Towards(corner, 2 * kReach), kRadius}}});
}

}  // namespace

RobotPlan AntPlan() {
  RobotPlan plan;
  plan.body.root = Root::kFree;
  plan.body.friction = 1.5f;
  std::vector<Part>& parts = plan.body.parts;
  parts.push_back({.name = "torso", .position = {0, 0, 0.75f}, .shapes = {Ball{0.25f}}});
  AddLeg({1, 1}, "front_left_leg", "aux_1", "front_left_foot", parts);
  AddLeg({-1, 1}, "front_right_leg", "aux_2", "front_right_foot", parts);
  AddLeg({-1, -1}, "left_back_leg", "aux_3", "left_back_foot", parts);
  AddLeg({1, -1}, "right_back_leg", "aux_4", "right_back_foot", parts);
  plan.feet = {"front_left_foot", "front_right_foot", "left_back_foot", "right_back_foot"};
  plan.stands = Stands;
  return plan;
}

}  // namespace dbr::bullet
