// Finds where the limbs and joints of a robot are, for drawing.
#pragma once

#include "envs/bullet/body_plan.h"
#include "envs/bullet/multibody.h"
#include "envs/figure.h"

namespace dbr::bullet {

// Replaces the limbs and joints of `figure` by those of `robot`. `plan` is the plan that the robot was made
// from.
void DescribeLimbs(const BodyPlan& plan, const Multibody& robot, Figure* figure);

}  // namespace dbr::bullet
