#include "deploy/terminal/progress_bar.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr int kBarCells = 20;
constexpr int kWidthWithoutTerminal = 200;
constexpr absl::Duration kRedrawEvery = absl::Milliseconds(100);

}  // namespace

std::string BarText(const BarState& state, int width) {
  const double total = static_cast<double>(std::max<std::int64_t>(state.total, 1));
  const double fraction = std::clamp(static_cast<double>(state.done) / total, 0.0, 1.0);
  const double seconds = absl::ToDoubleSeconds(state.elapsed);
  const double rate = seconds > 0 ? static_cast<double>(state.done) / seconds : 0;
  std::string text = absl::StrCat(state.label, "  ", Bar(fraction, kBarCells), " ", Fixed(100 * fraction, 0),
                                  "%  ", Compact(static_cast<double>(state.done)), " of ", Compact(total),
                                  " ", state.unit, " · ", Compact(rate), " ", state.unit, "/s");
  if (rate > 0) {
    const double left = static_cast<double>(std::max<std::int64_t>(0, state.total - state.done));
    absl::StrAppend(&text, " · ", Clock(absl::Seconds(left / rate)), " left");
  }
  return Truncate(text, width);
}

ProgressBar::ProgressBar(std::FILE* out, BarState state, absl::Time now, absl::Duration every)
    : out_(out),
      terminal_(IsTerminal(fileno(out))),
      every_(terminal_ ? kRedrawEvery : every),
      start_(now),
      last_(now),
      state_(std::move(state)) {}

ProgressBar::~ProgressBar() {
  if (!terminal_) return;
  std::fprintf(out_, "\r\033[K");
  std::fflush(out_);
}

void ProgressBar::Update(std::int64_t done, absl::Time now) {
  if (now - last_ < every_) return;
  last_ = now;
  state_.done = done;
  state_.elapsed = now - start_;
  if (terminal_) {
    // One cell is left free: some terminals wrap when the last one is written.
    std::fprintf(out_, "\r%s\033[K", BarText(state_, TerminalWidth(fileno(out_), 80) - 1).c_str());
  } else {
    std::fprintf(out_, "%s\n", BarText(state_, kWidthWithoutTerminal).c_str());
  }
  std::fflush(out_);
}

}  // namespace dbr
