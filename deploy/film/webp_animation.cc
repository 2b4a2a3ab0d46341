#include "deploy/film/webp_animation.h"

#include "absl/strings/str_cat.h"

namespace dbr {
namespace {

constexpr float kQuality = 30;  // of 100; enough for flat drawings
// The encoder does not draw small differences to the frame before, which leaves traces. Whole frames remove
// them.
constexpr int kFramesBetweenWholeOnes = 8;

}  // namespace

absl::StatusOr<std::unique_ptr<WebpAnimation>> WebpAnimation::Create(int width, int height) {
  std::unique_ptr<WebpAnimation> animation(new WebpAnimation(width, height));
  WebPAnimEncoderOptions options;
  if (!WebPAnimEncoderOptionsInit(&options) ||
      !WebPConfigPreset(&animation->config_, WEBP_PRESET_DEFAULT, kQuality)) {
    return absl::InternalError("the WebP library is of another version than its headers");
  }
  options.anim_params.loop_count = 0;  // repeat without end
  options.kmin = kFramesBetweenWholeOnes - 1;
  options.kmax = kFramesBetweenWholeOnes;
  animation->encoder_.reset(WebPAnimEncoderNew(width, height, &options));
  if (animation->encoder_ == nullptr) return absl::InternalError("the WebP encoder could not be made");
  return animation;
}

absl::Status WebpAnimation::Add(const std::uint8_t* pixels, int stride_bytes, int start_ms) {
  WebPPicture picture;
  if (!WebPPictureInit(&picture)) {
    return absl::InternalError("the WebP library is of another version than its headers");
  }
  picture.use_argb = 1;
  picture.width = width_;
  picture.height = height_;
  const bool added = WebPPictureImportBGRX(&picture, pixels, stride_bytes) &&
                     WebPAnimEncoderAdd(encoder_.get(), &picture, start_ms, &config_);
  WebPPictureFree(&picture);
  return added ? absl::OkStatus() : Failure("add a frame to");
}

absl::StatusOr<std::string> WebpAnimation::Finish(int end_ms) {
  WebPData file;
  WebPDataInit(&file);
  const bool assembled = WebPAnimEncoderAdd(encoder_.get(), nullptr, end_ms, nullptr) &&
                         WebPAnimEncoderAssemble(encoder_.get(), &file);
  std::string contents(reinterpret_cast<const char*>(file.bytes), assembled ? file.size : 0);
  WebPDataClear(&file);
  if (!assembled) return Failure("complete");
  return contents;
}

absl::Status WebpAnimation::Failure(const char* doing) const {
  return absl::InternalError(
      absl::StrCat("could not ", doing, " the animation: ", WebPAnimEncoderGetError(encoder_.get())));
}

}  // namespace dbr
