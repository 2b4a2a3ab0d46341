#include "replay/dataset/hdf5_id.h"

#include <algorithm>

namespace dbr {
namespace {

herr_t TakeFirst(unsigned /*depth*/, const H5E_error2_t* error, void* reason) {
  auto* const text = static_cast<std::string*>(reason);
  if (text->empty() && error->desc != nullptr) *text = error->desc;
  return 0;
}

herr_t AddName(hid_t /*group*/, const char* name, const H5L_info_t* /*info*/, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

}  // namespace

void SilenceHdf5() {
  // What is open is closed by its owner. A file that could not be closed for want of disk ends the program by
  // a signal where the library closes it again at exit.
  [[maybe_unused]] static const bool leaves_exit_alone = H5dont_atexit() >= 0;
  static thread_local const bool silent = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr) >= 0;
  static_cast<void>(silent);
}

std::vector<std::string> GroupKeys(hid_t file, const std::string& group) {
  std::vector<std::string> keys;
  H5Literate_by_name(file, group.c_str(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, AddName, &keys,
                     H5P_DEFAULT);
  std::sort(keys.begin(), keys.end());
  return keys;
}

std::string Hdf5Reason() {
  std::string reason;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, TakeFirst, &reason);
  return reason.empty() ? "no reason given" : reason;
}

}  // namespace dbr
