// The ant: a ball on four legs that moves freely in the world.
#pragma once

#include "envs/bullet/locomotion_task.h"

namespace dbr::bullet {

// 28 observations and 8 actions: hip and ankle of the front left, front right, back left and back right leg.
// It falls when its torso sinks below 0.26 m.
RobotPlan AntPlan();

}  // namespace dbr::bullet
