// Draws one moment of an episode: the figure, the floor that passes under it, and the numbers.
#pragma once

#include <cairo.h>

#include <cstdint>
#include <memory>
#include <string>

#include "envs/figure.h"

namespace dbr {

// The text in the picture.
struct FilmCaption {
  std::string title;
  int step = 0;
  double speed_m_s = 0;
  double episode_return = 0;
  std::string note;  // across the picture; empty: none
};

// One picture that is drawn again and again. The camera stays beside the figure. The first figure decides its
// distance. Owns the picture. One thread at a time.
class FilmCanvas {
 public:
  static constexpr int kWidth = 480;
  static constexpr int kHeight = 270;

  FilmCanvas();

  void Draw(const Figure& figure, const FilmCaption& caption);

  // Rows of blue, green, red and an unused byte, from the top. stride_bytes() is the distance from one row to
  // the next. Valid until the next Draw.
  const std::uint8_t* pixels();
  int stride_bytes() const;

 private:
  class Camera;
  struct Free {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { cairo_destroy(context); }
  };

  void DrawFloor(const Camera& camera);
  void DrawShadows(const Figure& figure, const Camera& camera);
  void DrawLimbs(const Figure& figure, const Camera& camera);
  void DrawCaption(const FilmCaption& caption);

  std::unique_ptr<cairo_surface_t, Free> surface_;
  std::unique_ptr<cairo_t, Free> cairo_;
  double pixels_a_metre_ = 0;  // 0 before the first figure
  Point eye_;                  // the place (m) in the middle of the picture
};

}  // namespace dbr
