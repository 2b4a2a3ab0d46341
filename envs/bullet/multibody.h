// A robot of a body plan as a Bullet multibody, link for link as PyBullet's importer makes it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "envs/bullet/body_plan.h"
#include "envs/bullet/world.h"

namespace dbr::bullet {

// Lives in a world that outlives it. One thread at a time. A hinged part takes two links, a massless one that
// turns and the part welded to it; a planar root takes three massless links. Hinges are numbered as in the
// plan.
class Multibody {
 public:
  static constexpr int kBase = -1;  // stands for the multibody's base where a link is asked for

  Multibody(const BodyPlan& plan, World& world);
  ~Multibody();
  Multibody(const Multibody&) = delete;
  Multibody& operator=(const Multibody&) = delete;

  // Stands the robot up at rest, its hinges at these angles (rad, one for each).
  void Reset(absl::Span<const double> hinge_angles);

  int num_hinges() const { return static_cast<int>(hinge_links_.size()); }
  double hinge_angle(int hinge) const { return body_->getJointPos(hinge_links_[hinge]); }
  double hinge_speed(int hinge) const { return body_->getJointVel(hinge_links_[hinge]); }  // rad/s
  // Turns a hinge with this torque throughout the next step of the world.
  void ApplyTorque(int hinge, double torque_nm) { body_->addJointTorque(hinge_links_[hinge], torque_nm); }

  // The pose of the centre of mass of a link.
  const btTransform& LinkPose(int link) const;
  // The velocity of the torso's centre of mass, in the world's axes (m/s).
  btVector3 TorsoVelocity() const;

  int num_links() const { return body_->getNumLinks(); }
  int torso_link() const { return PartLink(0); }
  // The link of a part, by its place in the plan.
  int PartLink(int part) const { return parts_[part].link; }
  // The place in the plan of the part of that name; CHECKs that there is one.
  int FindPart(absl::string_view name) const;

  const btMultiBody& bullet() const { return *body_; }

 private:
  struct PlacedPart {
    std::string name;
    int link;
    btVector3 centre;  // of mass, in the part's frame
  };

  void MakeBase(const BodyPlan& plan);
  void AddPlanarRoot(const Part& torso);
  void AddPart(const Part& part);
  void AddHinge(const Hinge& hinge, int parent, const btVector3& parent_to_pivot);
  // Fills in the next link as `part`, welded to `parent`, and gives it its collider.
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
  btAlignedObjectArray<btQuaternion> rotations_;  // working memory of Bullet's kinematics
  btAlignedObjectArray<btVector3> origins_;
  mutable std::vector<btVector3> link_turning_;  // of TorsoVelocity
  mutable std::vector<btVector3> link_velocities_;
};

}  // namespace dbr::bullet
