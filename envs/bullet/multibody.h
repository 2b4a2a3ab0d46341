// A robot as a Bullet multibody, with the same links as PyBullet's importer makes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "envs/bullet/body_plan.h"
#include "envs/bullet/world.h"

namespace dbr::bullet {

// Owns the Bullet multibody, its shapes and its colliders. The world must outlive it. One thread at a time. A
// hinged part takes two links: one without mass that turns, and the part welded to it. A planar root takes
// three links without mass. Hinges have the numbers of the plan.
class Multibody {
 public:
  static constexpr int kBase = -1;  // the multibody's base, in place of a link

  Multibody(const BodyPlan& plan, World& world);
  ~Multibody();
  Multibody(const Multibody&) = delete;
  Multibody& operator=(const Multibody&) = delete;

  // Puts the robot upright and at rest, with its hinges at these angles (rad, one for each hinge).
  void Reset(absl::Span<const double> hinge_angles);

  int num_hinges() const { return static_cast<int>(hinge_links_.size()); }
  double hinge_angle(int hinge) const { return body_->getJointPos(hinge_links_[hinge]); }
  double hinge_speed(int hinge) const { return body_->getJointVel(hinge_links_[hinge]); }  // rad/s
  // Applies this torque to a hinge throughout the next step of the world.
  void ApplyTorque(int hinge, double torque_nm) { body_->addJointTorque(hinge_links_[hinge], torque_nm); }

  // The pose of a link's centre of mass (m).
  const btTransform& LinkPose(int link) const;
  // The velocity of the torso's centre of mass, in the world's axes (m/s).
  btVector3 TorsoVelocity() const;

  int num_links() const { return body_->getNumLinks(); }
  int torso_link() const { return PartLink(0); }
  // The link of a part, by the part's index in the plan.
  int PartLink(int part) const { return parts_[part].link; }
  // The index in the plan of the part with that name. CHECKs that there is one. O(parts).
  int FindPart(absl::string_view name) const;

  const btMultiBody& bullet() const { return *body_; }

 private:
  struct PlacedPart {
    std::string name;
    int link;
    btVector3 centre;  // the centre of mass, in the part's frame
  };

  void MakeBase(const BodyPlan& plan);
  void AddPlanarRoot(const Part& torso);
  void AddPart(const Part& part);
  void AddHinge(const Hinge& hinge, int parent, const btVector3& parent_to_pivot);
  // Makes the next link: `part`, welded to `parent`, with its collider.
  void AddWeld(const Part& part, int parent, const btVector3& parent_to_frame);
  void AddMasslessCollider(int link, int group, int mask);
  void AddPartCollider(int link, btCollisionShape* shape);
  btMultiBodyLinkCollider& AddCollider(int link, btCollisionShape* shape, int group, int mask);
  void AddMotors();
  btCollisionShape* KeepShape(const Part& part);
  void UpdatePoses();

  World& world_;
  const float friction_;
  const int part_mask_;
  btTransform base_pose_;
  std::unique_ptr<btMultiBody> body_;
  std::vector<PlacedPart> parts_;
  std::vector<int> hinge_links_;
  int next_link_ = 0;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders_;  // the base's first, then the links'
  std::vector<std::unique_ptr<btMultiBodyConstraint>> constraints_;
  btAlignedObjectArray<btQuaternion> rotations_;  // workspaces of Bullet's kinematics
  btAlignedObjectArray<btVector3> origins_;
  mutable std::vector<btVector3> link_turning_;  // workspaces of TorsoVelocity
  mutable std::vector<btVector3> link_velocities_;
};

}  // namespace dbr::bullet
