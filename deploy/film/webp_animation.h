// Builds an animated WebP picture frame by frame.
#pragma once

#include <webp/encode.h>
#include <webp/mux.h>

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace dbr {

// The animation repeats without end. One thread at a time. All errors are Internal, with the encoder's words.
class WebpAnimation {
 public:
  static absl::StatusOr<std::unique_ptr<WebpAnimation>> Create(int width, int height);

  // Adds a frame that is shown from `start_ms` on. start_ms must be later than that of the frame before.
  // `pixels` has rows of blue, green, red and an unused byte, with stride_bytes from one row to the next.
  absl::Status Add(const std::uint8_t* pixels, int stride_bytes, int start_ms);

  // Returns the whole file. The last frame is shown until `end_ms`. Nothing can be added afterwards.
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
