// Numbers, bars and columns as people read them on a terminal.
#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"
#include "absl/time/time.h"

namespace dbr {

// 1234567 as "1,234,567".
std::string WithCommas(std::uint64_t value);
// 950, "1.2k", "45k", "3.4M": at most five characters up to a billion.
std::string Compact(double value);
// "1.5 MiB".
std::string Bytes(std::uint64_t bytes);
// "0:42", "6:12" or "1:02:03".
std::string Clock(absl::Duration duration);
// `value` with `digits` after the point; an en dash for a NaN or an infinite one.
std::string Fixed(double value, int digits);

// A bar of `width` cells, the share `fraction` of them filled (clipped to [0, 1]; NaN fills nothing), in
// eighths of a cell; padded with spaces to `width`.
std::string Bar(double fraction, int width);
// One cell whose height says `fraction`; a space for 0.
std::string Spark(double fraction);

// How many cells the UTF-8 text takes, one for each code point.
int DisplayWidth(absl::string_view text);
// The text with spaces behind it, or before it, up to `width` cells.
std::string PadRight(absl::string_view text, int width);
std::string PadLeft(absl::string_view text, int width);
// The first `width` cells of the text.
std::string Truncate(absl::string_view text, int width);

// Whether the file descriptor is a terminal that can be written over: not where TERM is unset, empty or
// "dumb", for such a terminal shows escape sequences as text and is written to as a file is.
bool IsTerminal(int fd);
// The columns and rows of the terminal at `fd`; `otherwise` where it is none.
int TerminalWidth(int fd, int otherwise);
int TerminalHeight(int fd, int otherwise);

}  // namespace dbr
