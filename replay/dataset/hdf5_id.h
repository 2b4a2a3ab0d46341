// Owning the HDF5 library's identifiers, and what it says of its errors.
#pragma once

#include <hdf5.h>

#include <string>
#include <utility>
#include <vector>

namespace dbr {

// Owns an identifier and closes it with the function that fits its kind. Thread-compatible.
class Hdf5Id {
 public:
  using Closer = herr_t (*)(hid_t);

  Hdf5Id() = default;
  Hdf5Id(hid_t id, Closer close) : id_(id), close_(close) {}
  ~Hdf5Id() { Close(); }
  Hdf5Id(Hdf5Id&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Hdf5Id& operator=(Hdf5Id&& other) noexcept {
    if (this != &other) {
      Close();
      id_ = std::exchange(other.id_, H5I_INVALID_HID);
      close_ = other.close_;
    }
    return *this;
  }

  hid_t get() const { return id_; }
  bool ok() const { return id_ >= 0; }
  // False where closing failed, as it does when the disk does not take what was still to be written.
  bool Close() { return id_ < 0 || close_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Closer close_ = nullptr;
};

// Keeps the library from printing this thread's errors to stderr, and from closing files while the program
// exits. Call it before anything else.
void SilenceHdf5();

// The names in a group of a file, sorted; none where it is no group.
std::vector<std::string> GroupKeys(hid_t file, const std::string& group);

// The innermost reason for which this thread's last failed call failed.
std::string Hdf5Reason();

}  // namespace dbr
