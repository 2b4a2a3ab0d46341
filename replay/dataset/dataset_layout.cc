#include "replay/dataset/dataset_layout.h"

#include "absl/strings/str_cat.h"

namespace dbr {

absl::StatusOr<DatasetLayout> ParseDatasetLayout(absl::string_view name) {
  for (const DatasetLayout layout :
       {DatasetLayout::kD4rl, DatasetLayout::kD4rlPybullet, DatasetLayout::kMinari}) {
    if (name == DatasetLayoutName(layout)) return layout;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("unknown layout '", name, "'; expected d4rl, d4rl_pybullet or minari"));
}

std::string DatasetLayoutName(DatasetLayout layout) {
  switch (layout) {
    case DatasetLayout::kD4rl:
      return "d4rl";
    case DatasetLayout::kD4rlPybullet:
      return "d4rl_pybullet";
    case DatasetLayout::kMinari:
      return "minari";
  }
  return "";
}

}  // namespace dbr
