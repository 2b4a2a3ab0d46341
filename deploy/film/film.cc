#include "deploy/film/film.h"

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "deploy/film/film_canvas.h"
#include "deploy/film/webp_animation.h"
#include "envs/figure.h"
#include "envs/registry/registry.h"

namespace dbr {
namespace {

constexpr int kStepsAFrame = 4;
constexpr int kFramesANumber = 4;   // numbers change only every fourth frame, so that they can be read
constexpr int kLastFrameMs = 1500;  // long enough to read how the episode ended

// Returns the names of the environments that can be filmed.
std::vector<std::string> NamesWithFigure() {
  std::vector<std::string> names;
  for (const std::string& name : EnvNames()) {
    const absl::StatusOr<std::unique_ptr<Env>> env = MakeEnv({.name = name, .opponents = {}});
    if (!env.ok()) continue;
    const EnvSpec& spec = (*env)->spec();
    std::vector<float> observation(spec.observation_size), mask(spec.actions.mask_width());
    (*env)->Reset(0, absl::MakeSpan(observation), absl::MakeSpan(mask));
    Figure figure;
    if ((*env)->GetFigure(&figure)) names.push_back(name);
  }
  return names;
}

absl::Status NoFigure(const std::string& env) {
  return absl::InvalidArgumentError(
      absl::StrCat("environment ", env,
                   " has no figure to film; expected one of: ", absl::StrJoin(NamesWithFigure(), ", ")));
}

std::string HowItEnded(const StepResult& result) {
  if (result.broken) return "ended: the simulation failed";
  return result.terminated ? "ended: it fell" : "ended: time is up";
}

// The frames of one episode.
class Film {
 public:
  explicit Film(std::unique_ptr<WebpAnimation> animation) : animation_(std::move(animation)) {}

  absl::Status Add(const Figure& figure, int step, const FilmCaption& caption) {
    canvas_.Draw(figure, caption);
    end_ms_ = static_cast<int>(std::lround(1000 * step * figure.seconds_a_step));
    ++frames_;
    return animation_->Add(canvas_.pixels(), canvas_.stride_bytes(), end_ms_);
  }
  absl::StatusOr<std::string> Finish() { return animation_->Finish(end_ms_ + kLastFrameMs); }
  int frames() const { return frames_; }

 private:
  FilmCanvas canvas_;
  std::unique_ptr<WebpAnimation> animation_;
  int end_ms_ = 0;
  int frames_ = 0;
};

}  // namespace

absl::StatusOr<FilmSummary> FilmEpisode(Env& env, const ChooseAction& choose, const FilmOptions& options,
                                        const std::atomic<bool>* cancelled) {
  const EnvSpec& spec = env.spec();
  std::vector<float> observation(spec.observation_size), mask(spec.actions.mask_width());
  std::vector<float> action(spec.actions.width());
  env.Reset(options.seed, absl::MakeSpan(observation), absl::MakeSpan(mask));
  Figure figure;
  if (!env.GetFigure(&figure)) return NoFigure(spec.name);
  ASSIGN_OR_RETURN(std::unique_ptr<WebpAnimation> animation,
                   WebpAnimation::Create(FilmCanvas::kWidth, FilmCanvas::kHeight));
  Film film(std::move(animation));
  FilmCaption caption{.title = spec.name, .step = 0, .speed_m_s = 0, .episode_return = 0, .note = ""};
  RETURN_IF_ERROR(film.Add(figure, /*step=*/0, caption));
  FilmSummary summary;
  double speed_m_s = 0;  // smoothed
  for (StepResult result; !result.done();) {
    if (cancelled != nullptr && *cancelled) return absl::CancelledError("the film was stopped");
    RETURN_IF_ERROR(choose(observation, mask, absl::MakeSpan(action)));
    result = env.Step(action, absl::MakeSpan(observation), absl::MakeSpan(mask));
    ++summary.steps;
    summary.episode_return += result.reward;
    if (summary.steps % kStepsAFrame != 0 && !result.done()) continue;
    if (!result.broken) env.GetFigure(&figure);  // a broken world has no place to draw
    speed_m_s += 0.3 * (figure.speed_m_s - speed_m_s);
    if (film.frames() % kFramesANumber == 0 || result.done()) {
      caption.step = summary.steps;
      caption.speed_m_s = speed_m_s;
      caption.episode_return = summary.episode_return;
    }
    if (result.done()) caption.note = HowItEnded(result);
    RETURN_IF_ERROR(film.Add(figure, summary.steps, caption));
  }
  ASSIGN_OR_RETURN(const std::string contents, film.Finish());
  RETURN_IF_ERROR(WriteFileAtomically(options.path, contents));
  summary.frames = film.frames();
  summary.bytes = contents.size();
  return summary;
}

}  // namespace dbr
