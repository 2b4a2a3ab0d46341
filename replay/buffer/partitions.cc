#include "replay/buffer/partitions.h"

#include "core/status_macros.h"

namespace dbr {

absl::StatusOr<Partitions> Partitions::Make(absl::string_view selector, std::uint32_t capacity) {
  Selectors selectors;
  for (auto& part : selectors) {
    ASSIGN_OR_RETURN(part, MakeSelector(selector, capacity));
  }
  return Partitions(std::move(selectors));
}

}  // namespace dbr
