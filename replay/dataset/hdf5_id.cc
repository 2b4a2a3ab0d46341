#include "replay/dataset/hdf5_id.h"

namespace dbr {
namespace {

herr_t TakeFirst(unsigned /*depth*/, const H5E_error2_t* error, void* reason) {
  auto* const text = static_cast<std::string*>(reason);
  if (text->empty() && error->desc != nullptr) *text = error->desc;
  return 0;
}

}  // namespace

void SilenceHdf5() {
  static thread_local const bool silent = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr) >= 0;
  static_cast<void>(silent);
}

std::string Hdf5Reason() {
  std::string reason;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, TakeFirst, &reason);
  return reason.empty() ? "no reason given" : reason;
}

}  // namespace dbr
