// Makes Bullet's shapes from a part of a body plan, and finds the part's mass.
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

// The rod's pose in the frame of its part. The rod's length is along z.
btTransform PoseOf(const Rod& rod);

// The centre of mass, where PyBullet's importer puts it: at the middle of the first bone, or at the frame's
// origin for a part that has only rods or a ball.
btVector3 CentreOf(const Part& part);

// The mass (kg) that the plan states, or else that of the volume at 1,000 kg/m3.
double MassOf(const Part& part);

// Makes the shapes of a part around its centre of mass. A single ball is returned as it is. Everything else
// is a compound; its children are appended to `children` and must live as long as it does.
std::unique_ptr<btCollisionShape> MakeShape(const Part& part,
                                            std::vector<std::unique_ptr<btCollisionShape>>& children);

}  // namespace dbr::bullet
