#include "deploy/progress.h"

#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "deploy/terminal.h"

namespace dbr {
namespace {

constexpr int kWidthWithoutTerminal = 200;

// The opponents whose scores are watched while a run goes on.
constexpr const char* kWatched[] = {"random", "mcts:10"};

const EvaluationReport* FindReport(const LearnerStatus& learner, absl::string_view opponent) {
  for (const EvaluationReport& report : learner.evaluations()) {
    if (report.opponent() == opponent) return &report;
  }
  return nullptr;
}

std::string Score(const RunSample& sample, absl::string_view opponent, bool words) {
  const EvaluationReport* report =
      sample.learner.has_value() ? FindReport(*sample.learner, opponent) : nullptr;
  if (report == nullptr) return "–";
  const std::string score = Fixed(report->score_mean(), 2);
  return words ? score : std::string(absl::StripPrefix(score, "0"));
}

// Environments without opponents have one evaluation, with its return.
std::string Scores(const RunSample& sample, bool words) {
  if (sample.learner.has_value()) {
    const EvaluationReport* report = FindReport(*sample.learner, "");
    if (report != nullptr) return absl::StrCat("return ", Fixed(report->return_mean(), 1));
  }
  std::vector<std::string> parts;
  const bool any = sample.learner.has_value() && sample.learner->evaluations_size() > 0;
  for (const char* opponent : kWatched) {
    if (any && !FindReport(*sample.learner, opponent)) continue;  // the config leaves it out
    const std::string name = words ? opponent : absl::StartsWith(opponent, "mcts") ? "mcts" : "rnd";
    parts.push_back(absl::StrCat(name, " ", Score(sample, opponent, words)));
  }
  return absl::StrJoin(parts, " ");
}

std::string Policy(const LearnerStatus& learner, bool words) {
  const std::uint64_t version = learner.policy_version();
  const std::uint64_t oldest = learner.oldest_subscriber_version();
  const bool known = learner.subscribers() > 0 && oldest <= version;
  const std::string lag = known ? absl::StrCat(version - oldest) : "–";
  return words ? absl::StrCat("policy ", version, " (lag ", lag, ")")
               : absl::StrCat("v", version, " lag ", lag);
}

std::string Line(const Progress& progress, bool words) {
  const StatsReply replay = progress.sample.replay.value_or(StatsReply());
  const LearnerStatus learner = progress.sample.learner.value_or(LearnerStatus());
  std::vector<std::string> parts;
  if (words) {
    parts = {absl::StrCat(WithCommas(replay.episodes()), " games"),
             absl::StrCat(Compact(replay.insert_rate()), " transitions/s"),
             absl::StrCat(Compact(learner.updates_per_second()), " updates/s"),
             absl::StrCat("D ", Compact(replay.total()), "  D+ ", Compact(replay.plus()), "  D- ",
                          Compact(replay.minus()))};
  } else {
    parts = {absl::StrCat(Compact(replay.episodes()), " games"),
             absl::StrCat(Compact(replay.insert_rate()), " t/s"),
             absl::StrCat(Compact(learner.updates_per_second()), " u/s"),
             absl::StrCat("D ", Compact(replay.total()), "+", Compact(replay.plus()), "-",
                          Compact(replay.minus()))};
  }
  parts.push_back(Policy(learner, words));
  parts.push_back(Scores(progress.sample, words));
  if (progress.sample.replay_away) parts.push_back("replay away");
  if (progress.sample.learner_away) parts.push_back("learner away");
  if (progress.left.has_value()) parts.push_back(absl::StrCat(Clock(*progress.left), words ? " left" : ""));
  return absl::StrJoin(parts, words ? " · " : " ");
}

}  // namespace

std::string ProgressText(const Progress& progress, int width) {
  const std::string words = Line(progress, /*words=*/true);
  if (DisplayWidth(words) <= width) return words;
  return Truncate(Line(progress, /*words=*/false), width);
}

ProgressLine::ProgressLine(std::FILE* out, absl::Duration every)
    : out_(out), terminal_(IsTerminal(fileno(out))), every_(every) {}

ProgressLine::~ProgressLine() {
  End();
}

void ProgressLine::Update(const Progress& progress, absl::Time now) {
  if (terminal_) {
    // One cell is left free: some terminals wrap when the last one is written.
    live_ = ProgressText(progress, TerminalWidth(fileno(out_), 80) - 1);
    std::fprintf(out_, "\r%s\033[K", live_.c_str());
  } else {
    if (now - last_ < every_) return;
    last_ = now;
    std::fprintf(out_, "%s\n", ProgressText(progress, kWidthWithoutTerminal).c_str());
  }
  std::fflush(out_);
}

void ProgressLine::Say(const std::string& text) {
  if (live_.empty()) {
    std::fprintf(out_, "%s\n", text.c_str());
  } else {
    std::fprintf(out_, "\r\033[K%s\n%s", text.c_str(), live_.c_str());
  }
  std::fflush(out_);
}

void ProgressLine::End() {
  if (live_.empty()) return;
  std::fputc('\n', out_);
  std::fflush(out_);
  live_.clear();
}

}  // namespace dbr
