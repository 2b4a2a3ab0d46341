#include "deploy/film/film_canvas.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_format.h"

namespace dbr {
namespace {

struct Colour {
  double red, green, blue;
};

constexpr Colour kSky{0.957, 0.949, 0.929};
constexpr Colour kGround{0.871, 0.855, 0.816};
constexpr Colour kMark{0.69, 0.667, 0.612};
constexpr Colour kInk{0.149, 0.180, 0.220};
constexpr Colour kFaintInk{0.478, 0.486, 0.498};
// The colours from the trunk to the feet.
constexpr Colour kLimbs[] = {
    {0.149, 0.275, 0.325}, {0.165, 0.616, 0.561}, {0.914, 0.769, 0.416}, {0.906, 0.435, 0.318}};
constexpr int kLimbColours = sizeof(kLimbs) / sizeof(kLimbs[0]);

constexpr double kGroundLine = 222;  // pixels from the top to the floor in the view from the side
constexpr double kSlant = 0.5;       // the view from above: sine of the angle by which it looks down
constexpr double kTurn = 0.45;       // rad: the camera's angle from the side towards the front

Colour Mix(const Colour& a, const Colour& b, double share_of_b) {
  const auto mix = [share_of_b](double x, double y) { return x + share_of_b * (y - x); };
  return {mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue)};
}

void Use(cairo_t* cairo, const Colour& colour, double opacity = 1) {
  cairo_set_source_rgba(cairo, colour.red, colour.green, colour.blue, opacity);
}

// A place in the picture, in pixels.
struct Spot {
  double x = 0;
  double y = 0;
};
// Draws a line with round ends: a disc where both ends are the same.
void Stroke(cairo_t* cairo, const Spot& from, const Spot& to, double width) {
  cairo_set_line_cap(cairo, CAIRO_LINE_CAP_ROUND);
  cairo_set_line_width(cairo, width);
  cairo_move_to(cairo, from.x, from.y);
  cairo_line_to(cairo, to.x, to.y);
  cairo_stroke(cairo);
}

enum class Align { kLeft, kCentre, kRight };
void Write(cairo_t* cairo, const std::string& text, const Spot& at, double size, bool bold, Align align) {
  cairo_select_font_face(cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cairo, size);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo, text.c_str(), &extents);
  const double share = align == Align::kLeft ? 0 : align == Align::kCentre ? 0.5 : 1;
  cairo_move_to(cairo, std::round(at.x - share * extents.x_advance), at.y);
  cairo_show_text(cairo, text.c_str());
}

// Returns 0 for a value that would print as -0.0 or 0.0 with one decimal.
double WithoutMinusZero(double value) {
  return std::abs(value) < 0.05 ? 0 : value;
}

}  // namespace

// Maps places in the world to spots in the picture, without perspective.
class FilmCanvas::Camera {
 public:
  Camera(View view, const Point& eye, double pixels_a_metre)
      : view_(view), eye_(eye), scale_(pixels_a_metre) {}

  Spot See(const Point& p) const {
    const double forward = p.x - eye_.x, left = p.y - eye_.y;
    if (view_ == View::kSide) return {0.5 * kWidth + scale_ * forward, kGroundLine - scale_ * p.z};
    const double right = std::cos(kTurn) * forward - std::sin(kTurn) * left;
    return {0.5 * kWidth + scale_ * right,
            0.68 * kHeight - scale_ * (kSlant * Away(p) + std::sqrt(1 - kSlant * kSlant) * p.z)};
  }
  // The distance behind the eye's place along the floor (m).
  double Away(const Point& p) const {
    return std::sin(kTurn) * (p.x - eye_.x) + std::cos(kTurn) * (p.y - eye_.y);
  }
  View view() const { return view_; }
  double scale() const { return scale_; }
  // Half the width of the visible floor (m), rounded up generously.
  double reach() const { return (view_ == View::kSide ? 0.5 : 1.0) * kWidth / scale_ + 1; }
  const Point& eye() const { return eye_; }

 private:
  const View view_;
  const Point eye_;
  const double scale_;
};

FilmCanvas::FilmCanvas()
    : surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, kWidth, kHeight)),
      cairo_(cairo_create(surface_.get())) {}

const std::uint8_t* FilmCanvas::pixels() {
  cairo_surface_flush(surface_.get());
  return cairo_image_surface_get_data(surface_.get());
}

int FilmCanvas::stride_bytes() const {
  return cairo_image_surface_get_stride(surface_.get());
}

void FilmCanvas::Draw(const Figure& figure, const FilmCaption& caption) {
  if (pixels_a_metre_ == 0) {
    double top = 0.1, reach = 0.1;  // m
    for (const Limb& limb : figure.limbs) {
      for (const Point& end : {limb.from, limb.to}) {
        top = std::max(top, end.z + limb.radius_m);
        reach = std::max(reach, std::abs(end.x - figure.place.x) + limb.radius_m);
      }
    }
    pixels_a_metre_ = std::min(0.56 * kHeight / top, 0.26 * kWidth / reach);
    eye_ = figure.place;
  }
  // The camera follows with a small delay, so that jolts are visible.
  eye_.x += 0.3 * (figure.place.x - eye_.x);
  eye_.y += 0.3 * (figure.place.y - eye_.y);
  // The camera moves by whole pixels, so that parts that stand still give the same picture and cost no bytes
  // in the file.
  const auto whole = [this](double metres) { return std::round(metres * pixels_a_metre_) / pixels_a_metre_; };
  const Camera camera(figure.view, {whole(eye_.x), whole(eye_.y), 0}, pixels_a_metre_);
  Use(cairo_.get(), kSky);
  cairo_paint(cairo_.get());
  DrawFloor(camera);
  DrawShadows(figure, camera);
  DrawLimbs(figure, camera);
  DrawCaption(caption);
}

// View from the side: a mark at each half metre, and the metres under the marks. View from above: squares of
// 1 m.
void FilmCanvas::DrawFloor(const Camera& camera) {
  cairo_t* const cairo = cairo_.get();
  const auto floor_of = [](double x) { return static_cast<int>(std::floor(x)); };
  const int first = floor_of(camera.eye().x - camera.reach()),
            last = floor_of(camera.eye().x + camera.reach());
  Use(cairo, kGround);
  if (camera.view() == View::kSlant) {
    cairo_paint(cairo);
    const int right = floor_of(camera.eye().y - camera.reach() / kSlant);
    const int left = floor_of(camera.eye().y + camera.reach() / kSlant);
    for (int x = first; x <= last; ++x) {
      for (int y = right; y <= left; ++y) {
        if ((x + y) % 2 != 0) continue;
        cairo_new_sub_path(cairo);
        for (const auto& [dx, dy] : {Spot{0, 0}, Spot{1, 0}, Spot{1, 1}, Spot{0, 1}}) {
          const Spot corner = camera.See({x + dx, y + dy, 0});
          cairo_line_to(cairo, corner.x, corner.y);
        }
        cairo_close_path(cairo);
      }
    }
    Use(cairo, Mix(kGround, kSky, 0.55));
    cairo_fill(cairo);
    return;
  }
  cairo_rectangle(cairo, 0, kGroundLine, kWidth, kHeight - kGroundLine);
  cairo_fill(cairo);
  for (int half = 2 * first; half <= 2 * last + 1; ++half) {
    const bool whole = half % 2 == 0;
    const Spot mark = camera.See({0.5 * half, 0, 0});
    Use(cairo, kMark);
    cairo_rectangle(cairo, mark.x - 1, kGroundLine, 2, whole ? 12 : 6);
    cairo_fill(cairo);
    Use(cairo, kFaintInk);
    if (whole)
      Write(cairo, absl::StrFormat("%d m", half / 2), {mark.x, kGroundLine + 26}, 11, false, Align::kCentre);
  }
  Use(cairo, kMark);
  cairo_rectangle(cairo, 0, kGroundLine, kWidth, 2);
  cairo_fill(cairo);
}

void FilmCanvas::DrawShadows(const Figure& figure, const Camera& camera) {
  Use(cairo_.get(), kInk, 0.12);
  cairo_push_group(cairo_.get());
  Use(cairo_.get(), kInk);
  for (const Limb& limb : figure.limbs) {
    const bool side = camera.view() == View::kSide;
    Spot from = camera.See({limb.from.x, limb.from.y, 0}), to = camera.See({limb.to.x, limb.to.y, 0});
    const double width = 2 * limb.radius_m * camera.scale();
    if (side) from.y = to.y = kGroundLine + 4;
    Stroke(cairo_.get(), from, to, side ? 4 : 0.8 * width);
  }
  cairo_pop_group_to_source(cairo_.get());
  cairo_paint_with_alpha(cairo_.get(), 0.16);
}

void FilmCanvas::DrawLimbs(const Figure& figure, const Camera& camera) {
  cairo_t* const cairo = cairo_.get();
  std::vector<Limb> limbs = figure.limbs;
  const auto depth = [&camera](const Limb& limb) {
    if (camera.view() == View::kSide) return limb.far_side ? 1.0 : 0.0;
    return 0.5 * (camera.Away(limb.from) + camera.Away(limb.to));
  };
  std::stable_sort(limbs.begin(), limbs.end(),
                   [&](const Limb& a, const Limb& b) { return depth(a) > depth(b); });
  for (const Limb& limb : limbs) {
    const Colour own = kLimbs[std::min(limb.rank, kLimbColours - 1)];
    const Colour colour = limb.far_side ? Mix(own, kSky, 0.5) : own;
    const Spot from = camera.See(limb.from), to = camera.See(limb.to);
    const double width = 2 * limb.radius_m * camera.scale();
    Use(cairo, Mix(colour, kInk, 0.45));
    Stroke(cairo, from, to, width);
    Use(cairo, colour);
    Stroke(cairo, from, to, std::max(1.0, width - 2.5));
    Use(cairo, Mix(colour, kSky, 0.35));
    const double raised = 0.2 * width;
    Stroke(cairo, {from.x - 0.5 * raised, from.y - raised}, {to.x - 0.5 * raised, to.y - raised},
           0.18 * width);
  }
  if (camera.view() != View::kSide) return;
  for (const Point& joint : figure.joints) {
    const Spot spot = camera.See(joint);
    Use(cairo, kInk);
    Stroke(cairo, spot, spot, 6);
    Use(cairo, kSky);
    Stroke(cairo, spot, spot, 3);
  }
}

void FilmCanvas::DrawCaption(const FilmCaption& caption) {
  cairo_t* const cairo = cairo_.get();
  Use(cairo, kInk);
  Write(cairo, caption.title, {16, 30}, 17, true, Align::kLeft);
  const struct {
    const char* name;
    std::string value;
    double right;
  } columns[] = {{"step", absl::StrFormat("%d", caption.step), 296},
                 {"speed", absl::StrFormat("%.1f m/s", WithoutMinusZero(caption.speed_m_s)), 378},
                 {"return", absl::StrFormat("%.0f", caption.episode_return), 464}};
  for (const auto& column : columns) {
    Use(cairo, kFaintInk);
    Write(cairo, column.name, {column.right, 20}, 10, false, Align::kRight);
    Use(cairo, kInk);
    Write(cairo, column.value, {column.right, 37}, 15, true, Align::kRight);
  }
  if (!caption.note.empty()) {
    Use(cairo, kInk);
    Write(cairo, caption.note, {16, 48}, 12, false, Align::kLeft);
  }
}

}  // namespace dbr
