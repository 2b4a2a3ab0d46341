#include "envs/bullet/limbs.h"

#include <variant>
#include <vector>

#include "envs/bullet/shapes.h"

namespace dbr::bullet {
namespace {

Point ToPoint(const btVector3& v) {
  return {v.x(), v.y(), v.z()};
}

// A shape in the frame of its part.
struct Segment {
  btVector3 from;
  btVector3 to;
  double radius_m;
};

Segment SegmentOf(const Shape& shape) {
  if (const auto* bone = std::get_if<Bone>(&shape)) return {Widen(bone->from), Widen(bone->to), bone->radius};
  if (const auto* rod = std::get_if<Rod>(&shape)) {
    const btTransform pose = PoseOf(*rod);
    const double half = 0.5 * rod->length;
    return {pose * btVector3(0, 0, -half), pose * btVector3(0, 0, half), rod->radius};
  }
  return {btVector3(0, 0, 0), btVector3(0, 0, 0), std::get<Ball>(shape).radius};
}

}  // namespace

void DescribeLimbs(const BodyPlan& plan, const Multibody& robot, Figure* figure) {
  figure->limbs.clear();
  figure->joints.clear();
  std::vector<int> ranks;
  for (std::size_t i = 0; i < plan.parts.size(); ++i) {
    const Part& part = plan.parts[i];
    ranks.push_back(part.parent.empty() ? 0 : ranks[robot.FindPart(part.parent)] + 1);
    const btTransform& pose = robot.LinkPose(robot.PartLink(static_cast<int>(i)));
    const btVector3 centre = CentreOf(part);
    for (const Shape& shape : part.shapes) {
      const Segment segment = SegmentOf(shape);
      figure->limbs.push_back({.from = ToPoint(pose * (segment.from - centre)),
                               .to = ToPoint(pose * (segment.to - centre)),
                               .radius_m = segment.radius_m,
                               .rank = ranks.back(),
                               .far_side = part.far_side});
    }
    if (part.hinge.has_value()) figure->joints.push_back(ToPoint(pose * (Widen(part.pivot) - centre)));
  }
}

}  // namespace dbr::bullet
