// An animated WebP picture, built frame by frame.
#pragma once

#include <webp/encode.h>
#include <webp/mux.h>

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace dbr {

// Plays for ever. One thread at a time. Errors: Internal, with what the encoder said.
class WebpAnimation {
 public:
  static absl::StatusOr<std::unique_ptr<WebpAnimation>> Create(int width, int height);

  // A frame to be seen from `start_ms` on, later than the one before. `pixels`: rows of blue, green, red and
  // an unused byte, each stride_bytes from the one before.
  absl::Status Add(const std::uint8_t* pixels, int stride_bytes, int start_ms);

  // The whole file; the last frame is seen until `end_ms`. Nothing can be added afterwards.
  absl::StatusOr<std::string> Finish(int end_ms);

 private:
  struct Free {
    void operator()(WebPAnimEncoder* encoder) const { WebPAnimEncoderDelete(encoder); }
  };

  WebpAnimation(int width, int height) : width_(width), height_(height) {}
  absl::Status Failure(const char* doing) const;

  const int width_;
  const int height_;
  WebPConfig config_;
  std::unique_ptr<WebPAnimEncoder, Free> encoder_;
};

}  // namespace dbr
