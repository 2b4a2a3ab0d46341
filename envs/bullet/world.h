// A Bullet world with a floor, set up as PyBullet's locomotion environments set up theirs.
#pragma once

#include <memory>

#include "BulletDynamics/Featherstone/btMultiBody.h"
#include "BulletDynamics/Featherstone/btMultiBodyConstraint.h"
#include "BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h"
#include "BulletDynamics/Featherstone/btMultiBodyLinkCollider.h"

namespace dbr::bullet {

// The groups that decide who may collide. PyBullet keeps a pair where EITHER group is in the other's mask.
inline constexpr int kMovingGroup = 1;
inline constexpr int kStaticGroup = 2;
inline constexpr int kCollidesWithAll = -1;

// Owns the world and the floor; robots add themselves, and go before it does. One thread at a time.
class World {
 public:
  static constexpr double kTimeStep = 0.0165;  // s, of an environment's step
  static constexpr int kSubsteps = 4;

  World();
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  // Moves on by kTimeStep. Joint torques hold for all of it and are gone afterwards.
  void Step();

  // Drops all contact points, so that the past has no part in what comes.
  void ForgetContacts();

  // Calls `visit` with the collider of each link that has a contact point with the floor, at any distance up
  // to Bullet's contact breaking threshold; a link may come more than once.
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
  std::unique_ptr<btMultiBodyDynamicsWorld> world_;  // last: goes before all that it refers to
};

}  // namespace dbr::bullet
