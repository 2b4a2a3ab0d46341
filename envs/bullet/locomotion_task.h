// The task of PyBullet's locomotion environments: walk to a point far ahead, cheaply and without falling.
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

// What decides whether a robot still stands.
struct Stance {
  double height_m = 0;                      // of the torso
  double pitch_rad = 0;                     // of the torso, forward
  absl::Span<const float> feet_on_floor{};  // 1 for each foot that touched the floor a step before
};

// A robot and what its task asks of it.
struct RobotPlan {
  BodyPlan body{};
  std::vector<std::string> feet{};  // the parts whose contact with the floor is observed, in that order
  bool (*stands)(const Stance& stance) = nullptr;
  bool falling_ends_episode = true;
};

// How an episode begins.
struct Start {
  std::vector<double> hinge_angles{};  // rad
  // Whether the floor counts among the parts whose mean is the robot's place. PyBullet counts it always but
  // in the very first reset of a new environment, whose first observation and potential differ by that.
  bool floor_in_mean = true;
};

// The start that a seed draws: every hinge's angle uniform in [-0.1, 0.1] rad.
Start DrawStart(int num_hinges, std::uint64_t seed);

// What a step of the task gave.
struct Progress {
  // Alive, progress, electricity, joints at their limits, collisions of feet (always 0).
  static constexpr int kTerms = 5;
  std::array<double, kTerms> terms{};
  double reward = 0;  // their sum
  bool fallen = false;
  bool finite = true;  // the observation and the reward are
};

// A robot in a world of its own. One thread at a time. Goes on after a fall; who calls decides when it ends.
//
// Observation: the torso's height over its start, sine and cosine of the angle from where it looks to the
// target, 0.3 times its velocity (forward, left, up as it looks), roll, pitch; for each hinge its place
// between the limits
// (-1 to 1) and 0.1 times its speed; for each foot whether it touched the floor a step before. All clipped to
// [-5, 5].
class LocomotionTask {
 public:
  explicit LocomotionTask(const RobotPlan& plan);
  ~LocomotionTask();

  int num_actions() const;
  int observation_size() const;

  // Both write the observation [observation_size()].
  void Begin(const Start& start, absl::Span<float> observation);
  // `action` [num_actions()]: the share of each hinge's torque, clipped to [-1, 1] for the torque, while its
  // cost is that of the action as given.
  Progress Advance(absl::Span<const float> action, absl::Span<float> observation);
  // The part of Advance that is the simulator's: moves the world on under an action and looks at nothing.
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
  std::vector<int> parts_in_mean_;  // links, in the order in which their places are added
  std::vector<int> foot_of_link_;   // index into feet_on_floor_, -1 for links that are no feet
  std::vector<float> feet_on_floor_;
  std::vector<float> hinge_places_;  // -1 and 1: at the limits
  std::vector<float> hinge_speeds_;  // 0.1 rad/s
  double start_height_m_ = 0;
  double potential_ = 0;
};

}  // namespace dbr::bullet
