// The task of PyBullet's locomotion environments: walk to a point far ahead, with little effort and without a
// fall.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "envs/bullet/body_plan.h"

namespace dbr {
struct Figure;
}

namespace dbr::bullet {

class Multibody;
class World;

// The state that decides whether a robot still stands.
struct Stance {
  double height_m = 0;                      // the torso's
  double pitch_rad = 0;                     // the torso's, forward
  absl::Span<const float> feet_on_floor{};  // 1 for each foot that touched the floor one step before
};

// A robot and the rules of its task.
struct RobotPlan {
  BodyPlan body{};
  std::vector<std::string> feet{};  // the parts whose contact with the floor is observed, in this order
  bool (*stands)(const Stance& stance) = nullptr;
  bool falling_ends_episode = true;
};

// The start of an episode.
struct Start {
  std::vector<double> hinge_angles{};  // rad
  // Whether the floor is one of the parts whose mean is the robot's place. In PyBullet it always is, except
  // in the first reset of a new environment. There, the first observation and potential differ for that
  // reason.
  bool floor_in_mean = true;
};

// The start that a random seed draws: every hinge's angle is uniform in [-0.1, 0.1] rad.
Start DrawStart(int num_hinges, std::uint64_t seed);

// The result of one step of the task.
struct Progress {
  // The terms of the reward: alive, progress, electricity, joints at their limits, collisions of feet (always
  // 0).
  static constexpr int kTerms = 5;
  std::array<double, kTerms> terms{};
  double reward = 0;  // their sum
  bool fallen = false;
  bool finite = true;  // whether the observation and the reward are finite
};

// A robot in a world of its own, which the task owns. One thread at a time. The task continues after a fall;
// the caller decides when the episode ends.
//
// Observation: the torso's height above its start; sine and cosine of the angle from the torso's direction to
// the target; 0.3 times its velocity in m/s (forward, left and up from that direction); roll and pitch in
// rad; for each hinge its place between the limits (-1 to 1) and 0.1 times its speed in rad/s; for each foot
// whether it touched the floor one step before. All values are clipped to [-5, 5].
class LocomotionTask {
 public:
  explicit LocomotionTask(const RobotPlan& plan);
  ~LocomotionTask();

  int num_actions() const;
  int observation_size() const;

  // Starts an episode. Begin and Advance write the observation [observation_size()].
  void Begin(const Start& start, absl::Span<float> observation);
  // Makes one step. `action` [num_actions()] is the share of each hinge's torque. It is clipped to [-1, 1]
  // for the torque, but the reward pays for the action as given.
  Progress Advance(absl::Span<const float> action, absl::Span<float> observation);
  // The simulator's part of Advance: moves the world by one step under an action, without observation or
  // reward.
  void Drive(absl::Span<const float> action);

  void GetFigure(Figure* figure) const;

  absl::Span<const float> feet_on_floor() const { return feet_on_floor_; }
  double potential() const { return potential_; }

 private:
  struct Place;

  Place Locate(bool floor_in_mean) const;
  void Observe(const Place& place, absl::Span<float> observation);
  void FeelFloor();
  double Electricity(absl::Span<const float> action) const;
  int CountHingesAtLimit() const;

  const RobotPlan plan_;
  std::unique_ptr<World> world_;
  std::unique_ptr<Multibody> robot_;
  std::vector<Hinge> hinges_;
  std::vector<int> parts_in_mean_;  // links, in the order in which NumPy adds their places
  std::vector<int> foot_of_link_;   // index into feet_on_floor_, or -1 for links that are not feet
  std::vector<float> feet_on_floor_;
  std::vector<float> hinge_places_;  // -1 and 1 are the limits
  std::vector<float> hinge_speeds_;  // 0.1 rad/s
  double start_height_m_ = 0;
  double potential_ = 0;
};

}  // namespace dbr::bullet
