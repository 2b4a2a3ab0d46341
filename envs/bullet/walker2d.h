// The walker: a torso on two legs of thigh, shank and foot, in a plane.
#pragma once

#include "envs/bullet/locomotion_task.h"

namespace dbr::bullet {

// 22 observations and 6 actions: hip, knee and ankle of the right leg, then of the left leg. It falls when
// its torso sinks below 0.8 m or leans by more than 1 rad.
RobotPlan Walker2dPlan();

}  // namespace dbr::bullet
