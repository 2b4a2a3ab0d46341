#include "deploy/cli/dataset_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr int kNameWidth = 13;

std::string Line(absl::string_view name, absl::string_view value) {
  return absl::StrCat("  ", PadRight(name, kNameWidth), value, "\n");
}

// The most lines of a distribution; with few episodes there are fewer.
constexpr int kMostBins = 10;
constexpr int kBarWidth = 30;

int BinsFor(std::size_t episodes) {
  return std::clamp(static_cast<int>(std::sqrt(static_cast<double>(episodes))), 1, kMostBins);
}

// A line for each of equal intervals between the least and the greatest return: its lower end, how many
// episodes lie in it, and a bar of that. Empty where all returns are the same, or none is known.
std::string ReturnDistribution(const DatasetFacts& facts) {
  const double width = facts.return_max - facts.return_min;
  if (facts.returns.empty() || !(width > 0)) return "";
  const int bins = BinsFor(facts.returns.size());
  std::vector<std::uint64_t> counts(static_cast<std::size_t>(bins));
  for (const float value : facts.returns) {
    const int bin = static_cast<int>((value - facts.return_min) / width * bins);
    ++counts[static_cast<std::size_t>(std::clamp(bin, 0, bins - 1))];
  }
  const double most = static_cast<double>(*std::max_element(counts.begin(), counts.end()));
  std::string text;
  for (int i = 0; i < bins; ++i) {
    const auto count = counts[static_cast<std::size_t>(i)];
    const std::string from = PadLeft(Fixed(facts.return_min + width * i / bins, 1), 9);
    absl::StrAppend(&text, Line(i == 0 ? "returns from" : "",
                                absl::StrCat(from, "  ", Bar(static_cast<double>(count) / most, kBarWidth),
                                             PadLeft(WithCommas(count), 9))));
  }
  return text;
}

}  // namespace

std::string DatasetText(const DatasetReport& report) {
  const DatasetFacts& facts = report.facts;
  std::string text = absl::StrCat(report.path, "\n", Line("layout", DatasetLayoutName(report.layout)));
  if (!report.env.empty()) absl::StrAppend(&text, Line("environment", report.env));
  absl::StrAppend(
      &text, Line("rows", WithCommas(facts.rows)), Line("transitions", WithCommas(facts.transitions)),
      Line("episodes",
           absl::StrCat(WithCommas(facts.episodes), " (", WithCommas(facts.terminals),
                        " ended by a terminal, ", WithCommas(facts.timeouts), " by the time limit)")),
      Line("return", absl::StrCat(Fixed(facts.return_mean, 1), " ± ", Fixed(facts.return_std, 1), " (from ",
                                  Fixed(facts.return_min, 1), " to ", Fixed(facts.return_max, 1), ")")),
      ReturnDistribution(facts),
      Line("bad rows", facts.bad_rows == 0
                           ? "0"
                           : absl::StrCat(WithCommas(facts.bad_rows),
                                          " (a value is not finite, or a flag neither 0 nor 1)")));
  for (const std::string& warning : WarningsOf(facts)) absl::StrAppend(&text, Line("warning", warning));
  return text;
}

nlohmann::ordered_json DatasetJson(const DatasetReport& report) {
  const DatasetFacts& facts = report.facts;
  return {{"layout", DatasetLayoutName(report.layout)},
          {"rows", facts.rows},
          {"transitions", facts.transitions},
          {"episodes", facts.episodes},
          {"terminals", facts.terminals},
          {"timeouts", facts.timeouts},
          {"non_finite", facts.bad_rows},
          {"bad_flags", facts.bad_flags},
          {"return",
           {{"mean", facts.return_mean},
            {"std", facts.return_std},
            {"min", facts.return_min},
            {"max", facts.return_max}}},
          {"actions_outside", facts.actions_outside},
          {"warnings", WarningsOf(facts)}};
}

}  // namespace dbr
