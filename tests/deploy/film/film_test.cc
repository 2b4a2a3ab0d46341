// Films of episodes: what the file holds, and who cannot be filmed.
#include "deploy/film/film.h"

#include <webp/demux.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/file_io.h"
#include "deploy/film/film_canvas.h"
#include "envs/figure.h"
#include "envs/registry/registry.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// Pushes every hinge to and fro.
ChooseAction Swing() {
  return [step = 0](absl::Span<const float>, absl::Span<const float>, absl::Span<float> action) mutable {
    ++step;
    for (std::size_t i = 0; i < action.size(); ++i) action[i] = (step / 8 + i) % 2 == 0 ? 0.4f : -0.4f;
    return absl::OkStatus();
  };
}

// Lets all hinges go; the robot sinks down soon.
absl::Status Rest(absl::Span<const float>, absl::Span<const float>, absl::Span<float> action) {
  std::fill(action.begin(), action.end(), 0.0f);
  return absl::OkStatus();
}

std::unique_ptr<Env> Make(const std::string& name) {
  return MakeEnv({.name = name, .opponents = {}}).value();
}

// The pictures of an animated WebP file, each as its pixels, and when each ends (ms).
struct Playback {
  WebPAnimInfo info{};
  std::vector<std::vector<std::uint32_t>> pictures;
  std::vector<int> ends_ms;
};
Playback Play(const std::string& path) {
  Playback playback;
  const std::string file = ReadFile(path).value();
  const WebPData contents = {reinterpret_cast<const std::uint8_t*>(file.data()), file.size()};
  WebPAnimDecoder* const decoder = WebPAnimDecoderNew(&contents, nullptr);
  if (decoder == nullptr) return playback;
  WebPAnimDecoderGetInfo(decoder, &playback.info);
  while (WebPAnimDecoderHasMoreFrames(decoder)) {
    std::uint8_t* pixels = nullptr;
    int end_ms = 0;
    if (!WebPAnimDecoderGetNext(decoder, &pixels, &end_ms)) break;
    const auto* const first = reinterpret_cast<const std::uint32_t*>(pixels);
    playback.pictures.emplace_back(first, first + FilmCanvas::kWidth * FilmCanvas::kHeight);
    playback.ends_ms.push_back(end_ms);
  }
  WebPAnimDecoderDelete(decoder);
  return playback;
}

class FilmTest : public testing::Test {
 protected:
  std::string Path() const { return folder_ / "film.webp"; }

  TempDir folder_;
};

TEST_F(FilmTest, ShowsTheEpisodeInRealTimeAndHoldsItsEnd) {
  for (const std::string name : {"hopper", "walker2d", "ant"}) {
    const auto env = Make(name);
    const absl::StatusOr<FilmSummary> film = FilmEpisode(*env, Rest, {.path = Path(), .seed = 2});
    ASSERT_TRUE(film.ok()) << film.status();
    EXPECT_GT(film->steps, 4) << name;
    EXPECT_EQ(film->bytes, std::filesystem::file_size(Path()));
    const Playback playback = Play(Path());
    ASSERT_EQ(playback.info.canvas_width, FilmCanvas::kWidth);
    ASSERT_EQ(playback.info.canvas_height, FilmCanvas::kHeight);
    EXPECT_EQ(playback.info.loop_count, 0u) << name;
    EXPECT_LE(playback.pictures.size(), static_cast<std::size_t>(film->frames)) << "frames alike are joined";
    EXPECT_NEAR(playback.ends_ms.back(), 1000 * 0.0165 * film->steps + 1500, 1) << name;
    EXPECT_NE(playback.pictures.front(), playback.pictures.back()) << name;
  }
}

TEST_F(FilmTest, TheSameEpisodeGivesTheSameFile) {
  std::set<std::string> files;
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(FilmEpisode(*Make("hopper"), Swing(), {.path = Path(), .seed = 5}).ok());
    files.insert(ReadFile(Path()).value());
  }
  EXPECT_EQ(files.size(), 1u);
}

TEST_F(FilmTest, AnEnvironmentWithoutAFigureIsAnsweredWithThoseThatHaveOne) {
  const absl::Status status = FilmEpisode(*Make("connect4"), Swing(), {.path = Path()}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("connect4"), HasSubstr("ant, half_cheetah, hopper, walker2d")));
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

TEST_F(FilmTest, ErrorsOfTheChooserAndOfTheFolderAreTold) {
  const ChooseAction fail = [](auto, auto, auto) { return absl::InternalError("no idea"); };
  EXPECT_EQ(FilmEpisode(*Make("hopper"), fail, {.path = Path()}).status(), absl::InternalError("no idea"));
  const absl::Status status =
      FilmEpisode(*Make("hopper"), Swing(), {.path = folder_ / "nowhere/film.webp"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
}

TEST_F(FilmTest, AWorldThatBreaksEndsTheFilmWithItsLastSoundPicture) {
  const ChooseAction fail = [step = 0](auto, auto, absl::Span<float> action) mutable {
    std::fill(action.begin(), action.end(), ++step < 8 ? 0.2f : std::numeric_limits<float>::quiet_NaN());
    return absl::OkStatus();
  };
  const absl::StatusOr<FilmSummary> film = FilmEpisode(*Make("ant"), fail, {.path = Path(), .seed = 1});
  ASSERT_TRUE(film.ok()) << film.status();
  EXPECT_EQ(film->steps, 8);
  EXPECT_GT(Play(Path()).pictures.size(), 1u);
}

TEST_F(FilmTest, ACancelledFilmLeavesNoFile) {
  const std::atomic<bool> cancelled = true;
  const absl::Status status = FilmEpisode(*Make("hopper"), Swing(), {.path = Path()}, &cancelled).status();
  EXPECT_TRUE(absl::IsCancelled(status));
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

// The colour of a spot of the picture.
std::uint32_t ColourAt(FilmCanvas& canvas, int x, int y) {
  const std::uint8_t* const pixel = canvas.pixels() + y * canvas.stride_bytes() + 4 * x;
  return pixel[0] | pixel[1] << 8 | pixel[2] << 16;
}

TEST(FilmCanvasTest, DrawsTheFigureInTheMiddleAndTheFloorBelow) {
  Figure figure;
  FilmCanvas canvas;
  figure.limbs = {{.from = {0, 0, 0.5}, .to = {0, 0, 1.5}, .radius_m = 0.1}};
  figure.place = {0, 0, 1};
  canvas.Draw(figure, {});
  const std::uint32_t sky = ColourAt(canvas, 20, 120);
  EXPECT_NE(ColourAt(canvas, FilmCanvas::kWidth / 2, 120), sky);
  EXPECT_NE(ColourAt(canvas, 20, FilmCanvas::kHeight - 5), sky);
  EXPECT_EQ(ColourAt(canvas, FilmCanvas::kWidth - 20, 120), sky);

  figure.limbs[0].far_side = true;
  const std::uint32_t near = ColourAt(canvas, FilmCanvas::kWidth / 2 + 2, 120);
  canvas.Draw(figure, {});
  EXPECT_NE(ColourAt(canvas, FilmCanvas::kWidth / 2 + 2, 120), near);
}

}  // namespace
}  // namespace dbr
