#include "envs/bullet/locomotion_task.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/rng.h"
#include "envs/bullet/limbs.h"
#include "envs/bullet/multibody.h"
#include "envs/bullet/numpy_sum.h"
#include "envs/bullet/world.h"
#include "envs/figure.h"

namespace dbr::bullet {
namespace {

constexpr double kTargetX = 1000;  // m
constexpr double kTargetY = 0;
constexpr int kTorsoValues = 8;  // values of an observation before hinges and feet
constexpr float kLargestValue = 5;
constexpr double kTorsoSpeedScale = 0.3;
constexpr double kHingeSpeedScale = 0.1;
constexpr float kAtLimit = 0.99f;
constexpr double kElectricityCost = -2.0;
constexpr double kStallTorqueCost = -0.1;
constexpr double kAtLimitCost = -0.1;

// Angles about forward, left and up (rad).
struct Attitude {
  double roll = 0;
  double pitch = 0;
  double yaw = 0;
};

// Where the pitch is straight up or down, only the difference of roll and yaw is known. It counts as yaw.
Attitude AttitudeOf(const btQuaternion& q) {
  constexpr double kVertical = 0.99999;
  constexpr double kRightAngle = 0.5 * SIMD_PI;
  const double sine = -2 * (q.x() * q.z() - q.w() * q.y());
  if (sine <= -kVertical) return {0, -kRightAngle, 2 * std::atan2(q.x(), -q.y())};
  if (sine >= kVertical) return {0, kRightAngle, 2 * std::atan2(-q.x(), q.y())};
  const double xx = q.x() * q.x(), yy = q.y() * q.y(), zz = q.z() * q.z(), ww = q.w() * q.w();
  return {std::atan2(2 * (q.y() * q.z() + q.w() * q.x()), ww - xx - yy + zz), std::asin(sine),
          std::atan2(2 * (q.x() * q.y() + q.w() * q.z()), ww + xx - yy - zz)};
}

// Returns the hinge's place between its limits, which are -1 and 1.
double PlaceBetweenLimits(const Hinge& hinge, double angle) {
  const double lower = hinge.lower_rad, upper = hinge.upper_rad;
  return 2 * (angle - 0.5 * (lower + upper)) / (upper - lower);
}

}  // namespace

// The place of the robot: the mean of its parts (m), and the torso's height (m) and attitude.
struct LocomotionTask::Place {
  double x = 0;
  double y = 0;
  double height = 0;
  Attitude attitude;

  // The potential. It grows by 1 in each step at a speed of 1 m/s.
  double Potential() const {
    const double dx = kTargetX - x, dy = kTargetY - y;
    return -std::sqrt(dy * dy + dx * dx) / World::kTimeStep;
  }
  double AngleToTarget() const { return std::atan2(kTargetY - y, kTargetX - x) - attitude.yaw; }
};

Start DrawStart(int num_hinges, std::uint64_t seed) {
  constexpr double kLargestAngle = 0.1;
  Rng rng(seed);
  Start start;
  for (int i = 0; i < num_hinges; ++i) start.hinge_angles.push_back(kLargestAngle * (2 * rng.Uniform() - 1));
  return start;
}

LocomotionTask::LocomotionTask(const RobotPlan& plan)
    : plan_(plan),
      world_(std::make_unique<World>()),
      robot_(std::make_unique<Multibody>(plan_.body, *world_)) {
  for (const Part& part : plan_.body.parts) {
    if (part.hinge.has_value()) hinges_.push_back(*part.hinge);
  }
  foot_of_link_.assign(robot_->num_links(), -1);
  for (std::size_t i = 0; i < plan_.feet.size(); ++i) {
    foot_of_link_[robot_->PartLink(robot_->FindPart(plan_.feet[i]))] = static_cast<int>(i);
  }
  // PyBullet lists the torso after the first link, at any place of the torso in the robot.
  const int torso = robot_->torso_link();
  for (int link = 0; link < robot_->num_links(); ++link) {
    if (link != torso) parts_in_mean_.push_back(link);
    if (link == 0) parts_in_mean_.push_back(torso);
  }
  feet_on_floor_.assign(plan_.feet.size(), 0);
  hinge_places_.assign(hinges_.size(), 0);
  hinge_speeds_.assign(hinges_.size(), 0);
}

LocomotionTask::~LocomotionTask() = default;

int LocomotionTask::num_actions() const {
  return static_cast<int>(hinges_.size());
}

int LocomotionTask::observation_size() const {
  return static_cast<int>(kTorsoValues + 2 * hinges_.size() + plan_.feet.size());
}

void LocomotionTask::Begin(const Start& start, absl::Span<float> observation) {
  robot_->Reset(start.hinge_angles);
  std::fill(feet_on_floor_.begin(), feet_on_floor_.end(), 0.0f);
  const Place place = Locate(start.floor_in_mean);
  start_height_m_ = place.height;
  potential_ = place.Potential();
  Observe(place, observation);
}

Progress LocomotionTask::Advance(absl::Span<const float> action, absl::Span<float> observation) {
  Drive(action);
  const Place place = Locate(/*floor_in_mean=*/true);
  Observe(place, observation);

  const double height = observation[0] + start_height_m_;
  const bool stands = plan_.stands({height, place.attitude.pitch, feet_on_floor_});
  const double potential = place.Potential();
  Progress progress;
  progress.terms = {stands ? 1.0 : -1.0, potential - potential_, Electricity(action),
                    kAtLimitCost * CountHingesAtLimit(), 0.0};
  for (const double term : progress.terms) progress.reward += term;
  progress.fallen = plan_.falling_ends_episode && !stands;
  progress.finite = std::isfinite(progress.reward);
  for (const float value : observation) progress.finite &= std::isfinite(value);
  potential_ = potential;
  FeelFloor();
  return progress;
}

void LocomotionTask::Drive(absl::Span<const float> action) {
  DBR_CHECK(action.size() == hinges_.size());
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    robot_->ApplyTorque(static_cast<int>(i), hinges_[i].torque_nm * std::clamp(action[i], -1.0f, 1.0f));
  }
  world_->Step();
}

LocomotionTask::Place LocomotionTask::Locate(bool floor_in_mean) const {
  // The floor is at the origin.
  const std::size_t count = parts_in_mean_.size() + (floor_in_mean ? 1 : 0);
  const auto mean = [&](int axis) {
    return NumpyMean<double>(count, [&](std::size_t i) {
      return i < parts_in_mean_.size() ? robot_->LinkPose(parts_in_mean_[i]).getOrigin()[axis] : 0.0;
    });
  };
  const btTransform& torso = robot_->LinkPose(robot_->torso_link());
  return {mean(0), mean(1), torso.getOrigin().z(), AttitudeOf(torso.getRotation())};
}

void LocomotionTask::Observe(const Place& place, absl::Span<float> observation) {
  DBR_CHECK(observation.size() == static_cast<std::size_t>(observation_size()));
  const double angle = place.AngleToTarget();
  const btVector3 velocity = robot_->TorsoVelocity();
  const double cosine = std::cos(-place.attitude.yaw), sine = std::sin(-place.attitude.yaw);
  const double forward = cosine * velocity.x() - sine * velocity.y();
  const double left = sine * velocity.x() + cosine * velocity.y();
  const double torso[kTorsoValues] = {place.height - start_height_m_,
                                      std::sin(angle),
                                      std::cos(angle),
                                      kTorsoSpeedScale * forward,
                                      kTorsoSpeedScale * left,
                                      kTorsoSpeedScale * velocity.z(),
                                      place.attitude.roll,
                                      place.attitude.pitch};
  float* out = observation.data();
  for (const double value : torso) *out++ = static_cast<float>(value);
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    const int hinge = static_cast<int>(i);
    hinge_places_[i] = static_cast<float>(PlaceBetweenLimits(hinges_[i], robot_->hinge_angle(hinge)));
    hinge_speeds_[i] = static_cast<float>(kHingeSpeedScale * robot_->hinge_speed(hinge));
    *out++ = hinge_places_[i];
    *out++ = hinge_speeds_[i];
  }
  std::copy(feet_on_floor_.begin(), feet_on_floor_.end(), out);
  for (float& value : observation) value = std::clamp(value, -kLargestValue, kLargestValue);
}

void LocomotionTask::FeelFloor() {
  std::fill(feet_on_floor_.begin(), feet_on_floor_.end(), 0.0f);
  world_->ForEachTouchingFloor([this](const btMultiBodyLinkCollider& collider) {
    const int foot = collider.m_link >= 0 ? foot_of_link_[collider.m_link] : -1;
    if (foot >= 0) feet_on_floor_[foot] = 1;
  });
}

// The cost of driving and holding the hinges, added in single precision as NumPy does with float32.
double LocomotionTask::Electricity(absl::Span<const float> action) const {
  const float driving =
      NumpyMean<float>(action.size(), [&](std::size_t i) { return std::abs(action[i] * hinge_speeds_[i]); });
  const float holding = NumpyMean<float>(action.size(), [&](std::size_t i) { return action[i] * action[i]; });
  return kElectricityCost * driving + kStallTorqueCost * holding;
}

int LocomotionTask::CountHingesAtLimit() const {
  int count = 0;
  for (const float place : hinge_places_) count += std::abs(place) > kAtLimit;
  return count;
}

void LocomotionTask::GetFigure(Figure* figure) const {
  const btVector3 place = robot_->LinkPose(robot_->torso_link()).getOrigin();
  figure->view = plan_.body.root == Root::kPlanar ? View::kSide : View::kSlant;
  figure->place = {place.x(), place.y(), place.z()};
  figure->speed_m_s = robot_->TorsoVelocity().x();
  figure->seconds_a_step = World::kTimeStep;
  DescribeLimbs(plan_.body, *robot_, figure);
}

}  // namespace dbr::bullet
