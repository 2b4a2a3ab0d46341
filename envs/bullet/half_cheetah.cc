#include "envs/bullet/half_cheetah.h"

#include <cmath>

namespace dbr::bullet {
namespace {

constexpr float kRadius = 0.046f;  // m, every limb's
constexpr double kFootMass = 10;   // kg: only the feet have another mass than their volume gives

// The indices in `feet` of the parts that are not feet: thighs and shins.
constexpr int kFrontShin = 1, kFrontThigh = 2, kBackShin = 4, kBackThigh = 5;

bool Stands(const Stance& stance) {
  const absl::Span<const float> touches = stance.feet_on_floor;
  return std::abs(stance.pitch_rad) < 1.0 && touches[kFrontShin] == 0 && touches[kFrontThigh] == 0 &&
         touches[kBackShin] == 0 && touches[kBackThigh] == 0;
}

Hinge Bend(float lower_rad, float upper_rad, double torque_nm) {
  return {.axis = {0, 1, 0}, .lower_rad = lower_rad, .upper_rad = upper_rad, .torque_nm = torque_nm};
}

}  // namespace

// Each part's frame is at its joint.
RobotPlan HalfCheetahPlan() {
  return {.body = {.root = Root::kPlanar,
                   .friction = 0.8f,
                   .parts = {{.name = "torso",
                              .position = {0, 0, 0.7f},
                              .shapes = {Bone{{-0.5f, 0, 0}, {0.5f, 0, 0}, kRadius},
                                         Rod{{0.6f, 0, 0.1f}, 0.87f, kRadius, 0.3f}}},
                             {.name = "bthigh",
                              .parent = "torso",
                              .position = {-0.5f, 0, 0},
                              .hinge = Bend(-0.52f, 1.05f, 108),
                              .shapes = {Rod{{0.1f, 0, -0.13f}, -3.8f, kRadius, 0.29f}}},
                             {.name = "bshin",
                              .parent = "bthigh",
                              .position = {0.16f, 0, -0.25f},
                              .hinge = Bend(-0.785f, 0.785f, 81),
                              .shapes = {Rod{{-0.14f, 0, -0.07f}, -2.03f, kRadius, 0.3f}}},
                             {.name = "bfoot",
                              .parent = "bshin",
                              .position = {-0.28f, 0, -0.14f},
                              .hinge = Bend(-0.4f, 0.785f, 54),
                              .shapes = {Rod{{0.03f, 0, -0.097f}, -0.27f, kRadius, 0.188f}},
                              .mass_kg = kFootMass},
                             {.name = "fthigh",
                              .parent = "torso",
                              .position = {0.5f, 0, 0},
                              .hinge = Bend(-1.5f, 0.8f, 126),
                              .shapes = {Rod{{-0.07f, 0, -0.12f}, 0.52f, kRadius, 0.266f}}},
                             {.name = "fshin",
                              .parent = "fthigh",
                              .position = {-0.14f, 0, -0.24f},
                              .hinge = Bend(-1.2f, 1.1f, 54),
                              .shapes = {Rod{{0.065f, 0, -0.09f}, -0.6f, kRadius, 0.212f}}},
                             {.name = "ffoot",
                              .parent = "fshin",
                              .position = {0.13f, 0, -0.18f},
                              .hinge = Bend(-3.1f, -0.3f, 27),
                              .shapes = {Rod{{0.045f, 0, -0.07f}, -0.6f, kRadius, 0.14f}},
                              .mass_kg = kFootMass}}},
          .feet = {"ffoot", "fshin", "fthigh", "bfoot", "bshin", "bthigh"},
          .stands = Stands,
          .falling_ends_episode = false};
}

}  // namespace dbr::bullet
