// The hopper: a torso, a thigh, a leg and a foot, in a plane.
#pragma once

#include "envs/bullet/locomotion_task.h"

namespace dbr::bullet {

// 15 observations and 3 actions: hip, knee and ankle. It falls when its torso sinks below 0.8 m or leans by
// more than 1 rad.
RobotPlan HopperPlan();

}  // namespace dbr::bullet
