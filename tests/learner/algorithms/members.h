// The algorithms that the conformance suite tests: all of the registry, each with its defaults and with its
// variants.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "learner/algorithm.h"
#include "learner/algorithms/registry.h"

namespace dbr {

// An algorithm with its defaults, or with one of its variants, in one of the two precisions.
struct Member {
  AlgorithmId id;
  std::string variant;  // a name in the source's table; empty: the defaults
  bool bfloat16 = false;
};

// All of them, in both precisions where the processor has them.
std::vector<Member> Members();

// A small problem for the member (SmallSpec).
AlgorithmSpec SpecOf(const Member& member, std::uint64_t seed = 1);

// The number of updates in which every network moves.
int CycleOf(const AlgorithmConfig& config);

// The number of updates after which every network has been used in every way. Where critics are drawn, the
// chance that one of them has not is below 1e-5.
int EnoughFor(const AlgorithmConfig& config);

}  // namespace dbr
