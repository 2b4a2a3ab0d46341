// The selectors by name: a new one is a file beside this one and a line here.
#include <array>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "replay/buffer/selectors/selector.h"
#include "replay/buffer/selectors/uniform.h"

namespace dbr {
namespace {

struct Entry {
  absl::string_view name;
  std::unique_ptr<Selector> (*make)(std::uint32_t capacity);
};

constexpr std::array kSelectors = {
    Entry{"uniform", MakeUniformSelector},
};

}  // namespace

std::vector<absl::string_view> SelectorNames() {
  std::vector<absl::string_view> names;
  for (const Entry& entry : kSelectors) names.push_back(entry.name);
  return names;
}

absl::StatusOr<std::unique_ptr<Selector>> MakeSelector(absl::string_view name, std::uint32_t capacity) {
  for (const Entry& entry : kSelectors) {
    if (entry.name == name) return entry.make(capacity);
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "selector: expected one of ", absl::StrJoin(SelectorNames(), ", "), ", found '", name, "'"));
}

}  // namespace dbr
