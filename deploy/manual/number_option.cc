#include "deploy/manual/number_option.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace dbr {

CLI::Validator WholeNumber(std::uint64_t least, std::uint64_t most) {
  const bool whole_type = least == 0 && most == std::numeric_limits<std::uint64_t>::max();
  const auto read = [least, most](std::string& text) -> std::string {
    const auto digit = [](char c) { return absl::ascii_isdigit(static_cast<unsigned char>(c)) != 0; };
    std::uint64_t value = 0;
    const bool number = !text.empty() && std::all_of(text.begin(), text.end(), digit) &&
                        absl::SimpleAtoi(text, &value) && value >= least && value <= most;
    if (!number)
      return absl::StrCat("expected a whole number of ", least, " to ", most, ", found '", text, "'");
    text = absl::StrCat(value);  // without leading zeros, which would make it octal
    return "";
  };
  return CLI::Validator(read, whole_type ? "" : absl::StrCat("INT in [", least, " - ", most, "]"));
}

}  // namespace dbr
