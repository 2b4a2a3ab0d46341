#include "core/symmetry.h"

#include <cstddef>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

absl::Status CheckInvolution(const char* name, const std::vector<int>& places, int size) {
  const auto refuse = [name](const auto&... what) {
    return absl::InvalidArgumentError(absl::StrCat("symmetry.", name, ": expected ", what...));
  };
  if (static_cast<int>(places.size()) != size) {
    return refuse(size, " places, one for each float, found ", places.size());
  }
  for (int i = 0; i < size; ++i) {
    const int image = places[static_cast<std::size_t>(i)];
    if (image < 0 || image >= size) return refuse("places from 0 to ", size - 1, ", found ", image);
    const int back = places[static_cast<std::size_t>(image)];
    if (back != i) {
      return refuse("a permutation that undoes itself, found that ", i, " goes to ", image, " and ", image,
                    " to ", back);
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckSymmetry(const Symmetry& symmetry, int observation_size, int actions) {
  RETURN_IF_ERROR(CheckInvolution("observation", symmetry.observation, observation_size));
  return CheckInvolution("action", symmetry.action, actions);
}

}  // namespace dbr
