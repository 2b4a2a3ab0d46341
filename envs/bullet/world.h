// A Bullet world with a floor, set up as in PyBullet's locomotion environments.
#pragma once

#include <memory>

#include "BulletDynamics/Featherstone/btMultiBody.h"
#include "BulletDynamics/Featherstone/btMultiBodyConstraint.h"
#include "BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h"
#include "BulletDynamics/Featherstone/btMultiBodyLinkCollider.h"

namespace dbr::bullet {

// The groups decide which objects may collide. PyBullet keeps a pair where EITHER object's group is in the
// other's mask.
inline constexpr int kMovingGroup = 1;
inline constexpr int kStaticGroup = 2;
inline constexpr int kCollidesWithAll = -1;

// Owns the Bullet world and the floor. Robots add themselves and must be destroyed before it. One thread at a
// time.
class World {
 public:
  static constexpr double kTimeStep = 0.0165;  // s, an environment's step
  static constexpr int kSubsteps = 4;

  World();
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  // Moves the world by kTimeStep. Joint torques hold during the whole step and are cleared after it.
  void Step();

  // Removes all contact points, so that the past has no effect on the next step.
  void ForgetContacts();

  // Calls `visit` with the collider of each link that has a contact point with the floor, at any distance up
  // to Bullet's contact breaking threshold. A link may be visited more than once. O(contact manifolds).
  template <typename Visit>
  void ForEachTouchingFloor(Visit visit) const {
    const int count = dispatcher_->getNumManifolds();
    for (int i = 0; i < count; ++i) {
      const btPersistentManifold* const manifold = dispatcher_->getManifoldByIndexInternal(i);
      if (manifold->getNumContacts() == 0) continue;
      const btCollisionObject* const a = manifold->getBody0();
      const btCollisionObject* const b = manifold->getBody1();
      if (a == floor_collider_.get()) visit(static_cast<const btMultiBodyLinkCollider&>(*b));
      if (b == floor_collider_.get()) visit(static_cast<const btMultiBodyLinkCollider&>(*a));
    }
  }

  btMultiBodyDynamicsWorld& bullet() { return *world_; }

 private:
  class PairFilter;

  void AddFloor();

  std::unique_ptr<PairFilter> pair_filter_;
  std::unique_ptr<btCollisionConfiguration> configuration_;
  std::unique_ptr<btCollisionDispatcher> dispatcher_;
  std::unique_ptr<btBroadphaseInterface> broadphase_;
  std::unique_ptr<btMultiBodyConstraintSolver> solver_;
  std::unique_ptr<btCollisionShape> floor_shape_;
  std::unique_ptr<btMultiBody> floor_;
  std::unique_ptr<btMultiBodyLinkCollider> floor_collider_;
  std::unique_ptr<btMultiBodyDynamicsWorld> world_;  // last: destroyed before everything that it uses
};

}  // namespace dbr::bullet
