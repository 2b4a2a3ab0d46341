// From a part of a body plan to Bullet's shapes and to what the part weighs.
#pragma once

#include <memory>
#include <vector>

#include "BulletCollision/CollisionShapes/btCollisionShape.h"
#include "LinearMath/btTransform.h"
#include "envs/bullet/body_plan.h"

namespace dbr::bullet {

inline btVector3 Widen(const Vec3& v) {
  return btVector3(v.x, v.y, v.z);
}

// In the frame of its part, its length along z.
btTransform PoseOf(const Rod& rod);

// The centre of mass as PyBullet's importer places it: the middle of the first bone, and the frame's origin
// for a part of rods or a ball alone.
btVector3 CentreOf(const Part& part);

// The mass that the plan states, else that of the volume at 1,000 kg/m3.
double MassOf(const Part& part);

// The shapes of a part about its centre of mass. A ball alone stands for itself, all else is a compound,
// whose children are appended to `children`; they have to live as long as it does.
std::unique_ptr<btCollisionShape> MakeShape(const Part& part,
                                            std::vector<std::unique_ptr<btCollisionShape>>& children);

}  // namespace dbr::bullet
