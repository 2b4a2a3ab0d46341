#include "envs/bullet/multibody.h"

#include <utility>

#include "BulletCollision/CollisionShapes/btCompoundShape.h"
#include "BulletDynamics/Featherstone/btMultiBodyJointLimitConstraint.h"
#include "BulletDynamics/Featherstone/btMultiBodyJointMotor.h"
#include "core/check.h"
#include "envs/bullet/shapes.h"

namespace dbr::bullet {
namespace {

constexpr int kPlanarRootLinks = 3;

const btVector3 kNowhere(0, 0, 0);

int CountLinks(const BodyPlan& plan) {
  int links = plan.root == Root::kPlanar ? kPlanarRootLinks : -1;  // a free torso is the base and not a link
  for (const Part& part : plan.parts) links += part.hinge.has_value() ? 2 : 1;
  return links;
}

btVector3 InertiaOf(const btCollisionShape& shape, double mass_kg) {
  btVector3 inertia;
  shape.calculateLocalInertia(mass_kg, inertia);
  return inertia;
}

}  // namespace

Multibody::Multibody(const BodyPlan& plan, World& world)
    : world_(world), friction_(plan.friction), part_mask_(plan.parts_collide ? kMovingGroup : 0) {
  DBR_CHECK(!plan.parts.empty() && plan.parts[0].parent.empty());
  base_pose_.setIdentity();
  MakeBase(plan);
  for (std::size_t i = 1; i < plan.parts.size(); ++i) AddPart(plan.parts[i]);
  DBR_CHECK(next_link_ == body_->getNumLinks());

  body_->setHasSelfCollision(true);
  body_->finalizeMultiDof();
  body_->setBaseWorldTransform(base_pose_);
  UpdatePoses();
  world_.bullet().addMultiBody(body_.get());
  AddMotors();
  link_turning_.resize(body_->getNumLinks() + 1);
  link_velocities_.resize(body_->getNumLinks() + 1);
}

Multibody::~Multibody() {
  for (const auto& constraint : constraints_) world_.bullet().removeMultiBodyConstraint(constraint.get());
  world_.bullet().removeMultiBody(body_.get());
  for (const auto& collider : colliders_) world_.bullet().removeCollisionObject(collider.get());
}

void Multibody::MakeBase(const BodyPlan& plan) {
  const Part& torso = plan.parts[0];
  if (plan.root == Root::kPlanar) {
    body_ = std::make_unique<btMultiBody>(CountLinks(plan), /*mass=*/0, kNowhere, /*fixed=*/true,
                                          /*can_sleep=*/false);
    AddMasslessCollider(kBase, kStaticGroup, kCollidesWithAll ^ kStaticGroup);
    colliders_.back()->setCollisionFlags(btCollisionObject::CF_STATIC_OBJECT);
    AddPlanarRoot(torso);
    return;
  }
  btCollisionShape* const shape = KeepShape(torso);
  const double mass_kg = MassOf(torso);
  body_ =
      std::make_unique<btMultiBody>(CountLinks(plan), mass_kg, InertiaOf(*shape, mass_kg), /*fixed=*/false,
                                    /*can_sleep=*/false);
  base_pose_.setOrigin(Widen(torso.position));
  parts_.push_back({torso.name, kBase, CentreOf(torso)});
  AddPartCollider(kBase, shape);
}

// Adds a slide forward, a slide up and a turn about the axis to the left. Each is a link without mass.
void Multibody::AddPlanarRoot(const Part& torso) {
  const btQuaternion straight = btQuaternion::getIdentity();
  body_->setupPrismatic(0, 0, kNowhere, kBase, straight, btVector3(1, 0, 0), Widen(torso.position), kNowhere,
                        true);
  AddMasslessCollider(0, kMovingGroup, kCollidesWithAll);
  body_->setupPrismatic(1, 0, kNowhere, 0, straight, btVector3(0, 0, 1), kNowhere, kNowhere, true);
  AddMasslessCollider(1, kMovingGroup, kCollidesWithAll);
  body_->setupRevolute(2, 0, kNowhere, 1, straight, btVector3(0, 1, 0), kNowhere, kNowhere, true);
  AddMasslessCollider(2, kMovingGroup, kCollidesWithAll);
  next_link_ = kPlanarRootLinks;
  AddWeld(torso, 2, kNowhere);
}

void Multibody::AddPart(const Part& part) {
  const PlacedPart& parent = parts_[FindPart(part.parent)];
  const btVector3 parent_to_pivot = Widen(part.position) + Widen(part.pivot) - parent.centre;
  if (!part.hinge.has_value()) {
    AddWeld(part, parent.link, parent_to_pivot);
    return;
  }
  AddHinge(*part.hinge, parent.link, parent_to_pivot);
  AddWeld(part, next_link_ - 1, -Widen(part.pivot));
}

void Multibody::AddHinge(const Hinge& hinge, int parent, const btVector3& parent_to_pivot) {
  const int link = next_link_++;
  body_->setupRevolute(link, 0, kNowhere, parent, btQuaternion::getIdentity(), Widen(hinge.axis),
                       parent_to_pivot, kNowhere, true);
  constraints_.push_back(
      std::make_unique<btMultiBodyJointLimitConstraint>(body_.get(), link, hinge.lower_rad, hinge.upper_rad));
  world_.bullet().addMultiBodyConstraint(constraints_.back().get());
  AddMasslessCollider(link, kMovingGroup, kCollidesWithAll);
  hinge_links_.push_back(link);
}

void Multibody::AddWeld(const Part& part, int parent, const btVector3& parent_to_frame) {
  const int link = next_link_++;
  btCollisionShape* const shape = KeepShape(part);
  const double mass_kg = MassOf(part);
  const btVector3 centre = CentreOf(part);
  body_->setupFixed(link, mass_kg, InertiaOf(*shape, mass_kg), parent, btQuaternion::getIdentity(),
                    parent_to_frame, centre);
  parts_.push_back({part.name, link, centre});
  AddPartCollider(link, shape);
}

btCollisionShape* Multibody::KeepShape(const Part& part) {
  std::unique_ptr<btCollisionShape> shape = MakeShape(part, shapes_);
  shapes_.push_back(std::move(shape));
  return shapes_.back().get();
}

// Bullet numbers its islands by colliders, so links without a shape need a collider too.
void Multibody::AddMasslessCollider(int link, int group, int mask) {
  auto empty = std::make_unique<btCompoundShape>();
  empty->setMargin(0);
  shapes_.push_back(std::move(empty));
  AddCollider(link, shapes_.back().get(), group, mask);
}

void Multibody::AddPartCollider(int link, btCollisionShape* shape) {
  AddCollider(link, shape, kMovingGroup, part_mask_).setFriction(friction_);
}

btMultiBodyLinkCollider& Multibody::AddCollider(int link, btCollisionShape* shape, int group, int mask) {
  colliders_.push_back(std::make_unique<btMultiBodyLinkCollider>(body_.get(), link));
  btMultiBodyLinkCollider& collider = *colliders_.back();
  collider.setCollisionShape(shape);
  world_.bullet().addCollisionObject(&collider, group, mask);
  if (link == kBase) {
    body_->setBaseCollider(&collider);
  } else {
    body_->getLink(link).m_collider = &collider;
    body_->getLink(link).m_flags |=
        BT_MULTIBODYLINKFLAGS_DISABLE_PARENT_COLLISION | BT_MULTIBODYLINKFLAGS_DISABLE_ALL_PARENT_COLLISION;
  }
  return collider;
}

// Adds a motor without force for every joint. They push nothing. But Bullet sorts all constraints of an
// island with a sort that is not stable, so the number of constraints decides the order in which the limits
// are solved.
void Multibody::AddMotors() {
  for (int link = 0; link < body_->getNumLinks(); ++link) {
    if (body_->getLink(link).m_dofCount == 0) continue;
    auto motor = std::make_unique<btMultiBodyJointMotor>(body_.get(), link, /*desired_velocity=*/0,
                                                         /*max_impulse=*/0);
    world_.bullet().addMultiBodyConstraint(motor.get());
    motor->finalizeMultiDof();
    constraints_.push_back(std::move(motor));
  }
}

void Multibody::Reset(absl::Span<const double> hinge_angles) {
  DBR_CHECK(hinge_angles.size() == hinge_links_.size());
  body_->setBaseWorldTransform(base_pose_);
  body_->clearVelocities();
  body_->clearForcesAndTorques();
  body_->clearConstraintForces();
  for (int link = 0; link < body_->getNumLinks(); ++link) {
    if (body_->getLink(link).m_dofCount > 0) body_->setJointPos(link, 0);
  }
  for (std::size_t i = 0; i < hinge_links_.size(); ++i) body_->setJointPos(hinge_links_[i], hinge_angles[i]);
  UpdatePoses();
  world_.ForgetContacts();
  world_.bullet().updateAabbs();
}

void Multibody::UpdatePoses() {
  body_->forwardKinematics(rotations_, origins_);
  body_->updateCollisionObjectWorldTransforms(rotations_, origins_);
}

const btTransform& Multibody::LinkPose(int link) const {
  return link == kBase ? body_->getBaseCollider()->getWorldTransform()
                       : body_->getLink(link).m_cachedWorldTransform;
}

btVector3 Multibody::TorsoVelocity() const {
  const int link = torso_link();
  if (link == kBase) return body_->getBaseVel();
  body_->compTreeLinkVelocities(link_turning_.data(), link_velocities_.data());
  return LinkPose(link).getBasis() * link_velocities_[link + 1];
}

int Multibody::FindPart(absl::string_view name) const {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (parts_[i].name == name) return static_cast<int>(i);
  }
  DBR_CHECK(!"a part of that name");
  return -1;
}

}  // namespace dbr::bullet
