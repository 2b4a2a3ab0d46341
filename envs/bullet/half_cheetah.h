// The half cheetah: a long torso with a head, a back leg and a front leg of thigh, shin and foot, in a plane.
#pragma once

#include "envs/bullet/locomotion_task.h"

namespace dbr::bullet {

// 26 observations and 6 actions: thigh, shin and foot of the back leg, then of the front leg. It loses its
// bonus when it leans by more than 1 rad or touches the floor with a thigh or shin. That does not end the
// episode.
RobotPlan HalfCheetahPlan();

}  // namespace dbr::bullet
