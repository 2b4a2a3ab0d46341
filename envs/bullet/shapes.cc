#include "envs/bullet/shapes.h"

#include <utility>

#include "btBulletCollisionCommon.h"

namespace dbr::bullet {
namespace {

constexpr double kDensity = 1000;  // kg/m3

// Adds a capsule's volume as a sphere and then a cylinder: the last bit of a mass depends on the order.
void AddCapsule(double radius, double length, double& volume) {
  volume += 4. / 3. * SIMD_PI * radius * radius * radius;
  volume += SIMD_PI * radius * radius * length;
}

double VolumeOf(const Part& part) {
  double volume = 0;  // m3
  for (const Shape& shape : part.shapes) {
    if (const auto* bone = std::get_if<Bone>(&shape)) {
      AddCapsule(bone->radius, (Widen(bone->to) - Widen(bone->from)).length(), volume);
    } else if (const auto* rod = std::get_if<Rod>(&shape)) {
      AddCapsule(rod->radius, rod->length, volume);
    } else {
      AddCapsule(std::get<Ball>(shape).radius, 0, volume);
    }
  }
  return volume;
}

std::unique_ptr<btCollisionShape> MakeChild(const Shape& shape) {
  if (const auto* bone = std::get_if<Bone>(&shape)) {
    const btVector3 ends[] = {Widen(bone->from), Widen(bone->to)};
    const btScalar radii[] = {bone->radius, bone->radius};
    return std::make_unique<btMultiSphereShape>(ends, radii, 2);
  }
  if (const auto* rod = std::get_if<Rod>(&shape)) {
    return std::make_unique<btCapsuleShapeZ>(rod->radius, rod->length);
  }
  return std::make_unique<btSphereShape>(std::get<Ball>(shape).radius);
}

}  // namespace

btTransform PoseOf(const Rod& rod) {
  return btTransform(btQuaternion(btVector3(0, 1, 0), rod.tilt_rad), Widen(rod.middle));
}

btVector3 CentreOf(const Part& part) {
  for (const Shape& shape : part.shapes) {
    if (const auto* bone = std::get_if<Bone>(&shape)) return 0.5 * (Widen(bone->from) + Widen(bone->to));
  }
  return btVector3(0, 0, 0);
}

double MassOf(const Part& part) {
  return part.mass_kg > 0 ? part.mass_kg : kDensity * VolumeOf(part);
}

std::unique_ptr<btCollisionShape> MakeShape(const Part& part,
                                            std::vector<std::unique_ptr<btCollisionShape>>& children) {
  if (part.shapes.size() == 1 && std::holds_alternative<Ball>(part.shapes[0]))
    return MakeChild(part.shapes[0]);
  auto compound = std::make_unique<btCompoundShape>();
  compound->setMargin(0);
  const btTransform from_centre(btQuaternion::getIdentity(), -CentreOf(part));
  for (const Shape& shape : part.shapes) {
    children.push_back(MakeChild(shape));
    const auto* rod = std::get_if<Rod>(&shape);
    compound->addChildShape(rod == nullptr ? from_centre : from_centre * PoseOf(*rod), children.back().get());
  }
  return compound;
}

}  // namespace dbr::bullet
