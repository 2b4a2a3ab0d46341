#include "deploy/cli/dataset_report.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr int kNameWidth = 13;

std::string Line(absl::string_view name, absl::string_view value) {
  return absl::StrCat("  ", PadRight(name, kNameWidth), value, "\n");
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
