// n-step transitions by a plain loop, for the tests of this folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace dbr {

// A transition as the numbers of its single steps.
struct PlainNStep {
  std::vector<std::size_t> steps;
};

// The transitions of up to n steps of `envs` environments, in the order in which they are complete. Step j of
// `count` is one of environment j % envs; ends(j) is true where it ends its episode. Those of episodes that
// do not end within `count` come last, environment by environment.
template <class Ends>
std::vector<PlainNStep> PlainNSteps(std::size_t count, int envs, int n, const Ends& ends) {
  struct Placed {
    std::size_t complete_with;  // the number of the step; or behind all steps
    int env;
    std::size_t start;
    PlainNStep transition;
  };
  std::vector<Placed> all;
  const auto stride = static_cast<std::size_t>(envs);
  for (std::size_t start = 0; start < count; ++start) {
    PlainNStep transition;
    std::size_t j = start;
    bool complete = false;
    for (; j < count && !complete; j += stride) {
      transition.steps.push_back(j);
      complete = ends(j) || static_cast<int>(transition.steps.size()) == n;
    }
    all.push_back({complete ? j - stride : count, static_cast<int>(start % stride), start, transition});
  }
  std::stable_sort(all.begin(), all.end(), [count](const Placed& a, const Placed& b) {
    if (a.complete_with != b.complete_with) return a.complete_with < b.complete_with;
    if (a.complete_with == count && a.env != b.env) return a.env < b.env;
    return a.start < b.start;
  });
  std::vector<PlainNStep> transitions;
  for (Placed& placed : all) transitions.push_back(std::move(placed.transition));
  return transitions;
}

}  // namespace dbr
