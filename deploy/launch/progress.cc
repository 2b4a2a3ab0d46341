#include "deploy/launch/progress.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr int kWidthWithoutTerminal = 200;

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

std::string Scores(const Progress& progress, bool words) {
  const RunSample& sample = progress.sample;
  std::vector<std::string> parts;
  const bool any = sample.learner.has_value() && sample.learner->evaluations_size() > 0;
  for (const WatchedOpponent& opponent : progress.presentation.watched) {
    if (any && !FindReport(*sample.learner, opponent.name)) continue;  // the config leaves it out
    parts.push_back(
        absl::StrCat(words ? opponent.name : opponent.short_name, " ", Score(sample, opponent.name, words)));
  }
  if (!parts.empty()) return absl::StrJoin(parts, " ");
  // The config leaves out all that are watched: those that it has are shown.
  for (const EvaluationReport& report : sample.learner->evaluations())
    parts.push_back(absl::StrCat(report.opponent(), " ", Score(sample, report.opponent(), words)));
  return absl::StrJoin(parts, " ");
}

std::string EvaluatedReturn(const RunSample& sample) {
  const EvaluationReport* report = sample.learner.has_value() ? FindReport(*sample.learner, "") : nullptr;
  return report == nullptr ? "–" : Fixed(report->return_mean(), 1);
}

std::string TrainReturn(const StatsReply& replay) {
  return replay.episodes() == 0 ? "–" : Fixed(replay.recent_return_mean(), 1);
}

std::string Policy(const LearnerStatus& learner, bool words) {
  const std::uint64_t version = learner.policy_version();
  const std::uint64_t oldest = learner.oldest_subscriber_version();
  const bool known = learner.subscribers() > 0 && oldest <= version;
  const std::string lag = known ? absl::StrCat(version - oldest) : "–";
  return words ? absl::StrCat("policy ", version, " (lag ", lag, ")")
               : absl::StrCat("v", version, " lag ", lag);
}

// What acting and learning do.
std::vector<std::string> Doing(const Progress& progress, const StatsReply& replay,
                               const LearnerStatus& learner, bool words) {
  const std::string rate = absl::StrCat(Compact(learner.updates_per_second()), words ? " updates/s" : " u/s");
  if (progress.offline_updates > 0) {
    return {words ? absl::StrCat("offline: ", WithCommas(learner.updates()), " of ",
                                 WithCommas(progress.offline_updates), " updates")
                  : absl::StrCat("offline ", Compact(static_cast<double>(learner.updates())), "/",
                                 Compact(static_cast<double>(progress.offline_updates))),
            rate};
  }
  const EnvPresentation& env = progress.presentation;
  return {
      absl::StrCat(words ? WithCommas(replay.episodes()) : Compact(static_cast<double>(replay.episodes())),
                   " ", words ? env.episodes : env.short_episodes),
      absl::StrCat(Compact(replay.insert_rate()), words ? " transitions/s" : " t/s"), rate};
}

std::vector<std::string> Success(const Progress& progress, const StatsReply& replay, bool words) {
  if (!progress.presentation.watched.empty()) return {Scores(progress, words)};
  std::vector<std::string> parts;
  if (progress.offline_updates == 0)
    parts.push_back(absl::StrCat(words ? "train return " : "train ", TrainReturn(replay)));
  parts.push_back(absl::StrCat(words ? "eval return " : "eval ", EvaluatedReturn(progress.sample)));
  return parts;
}

std::string Line(const Progress& progress, bool words) {
  const StatsReply replay = progress.sample.replay.value_or(StatsReply());
  const LearnerStatus learner = progress.sample.learner.value_or(LearnerStatus());
  std::vector<std::string> parts = Doing(progress, replay, learner, words);
  parts.push_back(absl::StrCat("D ", Compact(replay.total()), words ? "  D+ " : "+", Compact(replay.plus()),
                               words ? "  D- " : "-", Compact(replay.minus())));
  parts.push_back(Policy(learner, words));
  for (std::string& part : Success(progress, replay, words)) parts.push_back(std::move(part));
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

ProgressLine::ProgressLine(Output* out, absl::Duration every)
    : out_(out), terminal_(IsTerminal(out->fd())), every_(every) {}

ProgressLine::~ProgressLine() {
  End();
}

void ProgressLine::Update(const Progress& progress, absl::Time now) {
  if (out_->behind()) return;  // a newer line will follow
  if (terminal_) {
    // One cell is left free: some terminals wrap when the last one is written.
    live_ = ProgressText(progress, TerminalWidth(out_->fd(), 80) - 1);
    out_->Write(absl::StrCat("\r", live_, "\033[K"));
  } else {
    if (now - last_ < every_) return;
    last_ = now;
    out_->Write(absl::StrCat(ProgressText(progress, kWidthWithoutTerminal), "\n"));
  }
}

void ProgressLine::Say(const std::string& text) {
  out_->Write(live_.empty() ? absl::StrCat(text, "\n") : absl::StrCat("\r\033[K", text, "\n", live_));
}

void ProgressLine::End() {
  if (live_.empty()) return;
  out_->Write("\n");
  live_.clear();
}

}  // namespace dbr
