// What people are told of Connect-4.
#pragma once

#include "envs/presentation.h"

namespace dbr::connect4 {

// The published scores are the two Connect-4 rows of the table of results in Siu, Traish and Xu 2021
// (arXiv 2109.09037). deploy/experiments/paper.textproto has them too; a test keeps the two equal.
EnvPresentation Presentation();

}  // namespace dbr::connect4
