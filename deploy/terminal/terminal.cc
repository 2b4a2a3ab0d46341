#include "deploy/terminal/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace dbr {
namespace {

bool StartsCodePoint(char c) {
  return (static_cast<unsigned char>(c) & 0xC0) != 0x80;
}

}  // namespace

std::string WithCommas(std::uint64_t value) {
  std::string digits = absl::StrCat(value);
  for (int i = static_cast<int>(digits.size()) - 3; i > 0; i -= 3) digits.insert(i, 1, ',');
  return digits;
}

std::string Compact(double value) {
  if (!std::isfinite(value)) return "–";
  double scaled = value;
  absl::string_view unit = "";
  for (const absl::string_view larger : {"k", "M", "G", "T"}) {
    if (std::abs(scaled) < 999.5) break;
    scaled /= 1000;
    unit = larger;
  }
  const bool decimals = !unit.empty() && std::abs(scaled) < 9.95;
  return absl::StrFormat("%.*f%s", decimals ? 1 : 0, scaled, unit);
}

std::string Bytes(std::uint64_t bytes) {
  double scaled = static_cast<double>(bytes);
  absl::string_view unit = "B";
  for (const absl::string_view larger : {"KiB", "MiB", "GiB", "TiB"}) {
    if (scaled < 1023.5) break;
    scaled /= 1024;
    unit = larger;
  }
  return absl::StrFormat("%.*f %s", unit == "B" || scaled >= 99.95 ? 0 : 1, scaled, unit);
}

std::string Clock(absl::Duration duration) {
  const std::int64_t seconds =
      std::max<std::int64_t>(0, absl::ToInt64Seconds(absl::Ceil(duration, absl::Seconds(1))));
  if (seconds >= 3600)
    return absl::StrFormat("%d:%02d:%02d", seconds / 3600, seconds / 60 % 60, seconds % 60);
  return absl::StrFormat("%d:%02d", seconds / 60, seconds % 60);
}

std::string Fixed(double value, int digits) {
  return std::isfinite(value) ? absl::StrFormat("%.*f", digits, value) : "–";
}

std::string Bar(double fraction, int width) {
  static constexpr std::array<const char*, 8> kPart = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉"};
  const double clipped = std::isnan(fraction) ? 0 : std::clamp(fraction, 0.0, 1.0);
  const int eighths = static_cast<int>(std::lround(clipped * width * 8));
  std::string bar;
  for (int i = 0; i < eighths / 8; ++i) bar += "█";
  bar += kPart[eighths % 8];
  return PadRight(bar, width);
}

std::string Spark(double fraction) {
  static constexpr std::array<const char*, 9> kHeight = {" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  if (std::isnan(fraction) || fraction <= 0) return kHeight[0];
  return kHeight[std::clamp(static_cast<int>(std::lround(fraction * 8)), 1, 8)];
}

int DisplayWidth(absl::string_view text) {
  return static_cast<int>(std::count_if(text.begin(), text.end(), StartsCodePoint));
}

std::string PadRight(absl::string_view text, int width) {
  return absl::StrCat(text, std::string(std::max(0, width - DisplayWidth(text)), ' '));
}

std::string PadLeft(absl::string_view text, int width) {
  return absl::StrCat(std::string(std::max(0, width - DisplayWidth(text)), ' '), text);
}

std::string Truncate(absl::string_view text, int width) {
  int cells = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (StartsCodePoint(text[i]) && ++cells > width) return std::string(text.substr(0, i));
  }
  return std::string(text);
}

bool IsTerminal(int fd) {
  const char* const type = std::getenv("TERM");
  return type != nullptr && *type != '\0' && absl::string_view(type) != "dumb" && isatty(fd) == 1;
}

int TerminalWidth(int fd, int otherwise) {
  winsize size{};
  if (ioctl(fd, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return otherwise;
  return size.ws_col;
}

int TerminalHeight(int fd, int otherwise) {
  winsize size{};
  if (ioctl(fd, TIOCGWINSZ, &size) != 0 || size.ws_row == 0) return otherwise;
  return size.ws_row;
}

}  // namespace dbr
