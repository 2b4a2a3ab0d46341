#include "deploy/experiment/run.h"

#include <sys/wait.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"
#include "core/run_folder.h"
#include "core/status_macros.h"
#include "deploy/launch/summary_reader.h"
#include "deploy/process/child_process.h"
#include "deploy/process/interrupt.h"
#include "deploy/process/log_tail.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

constexpr absl::Duration kLookEvery = absl::Seconds(1);
constexpr absl::Duration kLineEvery = absl::Minutes(1);  // where the output is no terminal
constexpr absl::Duration kStopGrace =
    absl::Minutes(10);  // a launch waits for its own processes, one kind after another
constexpr int kLastLines = 8;

bool WasStopped(int wait_status) {
  return WIFSIGNALED(wait_status) || WEXITSTATUS(wait_status) == kInterruptedExit;
}

// Before what stands in the cell's place is moved away for a run that could not begin.
absl::Status CheckSeedBufferIsThere(const Cell& cell) {
  const std::string& path = cell.config.replay().seed_buffer().path();
  std::error_code ignored;
  if (path.empty() || std::filesystem::exists(path, ignored)) return absl::OkStatus();
  return absl::NotFoundError(
      absl::StrCat("expected its seed buffer, found no file '", path, "'; nothing was changed"));
}

}  // namespace

ExperimentRun::ExperimentRun(Grid grid, ExperimentOptions options, Output* out)
    : title_(absl::StrCat("experiment ", grid.name, " at scale ", grid.scale)),
      run_dir_(grid.run_dir),
      options_(std::move(options)),
      screen_(out, kLineEvery) {
  for (Cell& cell : grid.cells) {
    entries_.emplace_back();
    entries_.back().cell = std::move(cell);
  }
}

absl::StatusOr<int> ExperimentRun::Run() {
  Survey();
  Announce();
  SupervisorOptions supervision;
  supervision.orphan_grace = kStopGrace;
  ASSIGN_OR_RETURN(supervisor_, Supervisor::Create(std::move(supervision)));
  while (supervisor_->stop_signals() == 0) {
    StartDue();
    if (running_.empty()) break;
    ReadProgress();
    screen_.Update(State(), MonotonicNow());
    RETURN_IF_ERROR(supervisor_->Wait(MonotonicNow() + kLookEvery));
    TakeEnded();
  }
  if (!running_.empty())
    screen_.Say("stopping; the running cells save everything first (another Ctrl-C kills them)");
  supervisor_->Stop();
  TakeEnded();
  const bool signalled = supervisor_->stop_signals() > 0;
  supervisor_.reset();
  return Conclude(signalled);
}

// What is there already. Settled cells go through the schedule too, but take no room in it.
void ExperimentRun::Survey() {
  std::vector<CellDemand> demands;
  for (Entry& entry : entries_) {
    const CellStanding standing = ReadStanding(entry.cell);
    entry.before = standing.summary;
    const bool settled = Settle(&entry, standing);
    demands.push_back({entry.cell.seed, settled ? 0 : CellCost(entry.cell.config)});
  }
  schedule_ = std::make_unique<Schedule>(std::move(demands), options_.capacity);
}

void ExperimentRun::Announce() {
  screen_.Say(absl::StrCat(title_, ": ", entries_.size(), entries_.size() == 1 ? " cell" : " cells", ", ",
                           Count(Outcome::kDone), " done already, ", Count(Outcome::kWaiting), " to run",
                           options_.capacity.jobs > 0
                               ? absl::StrCat(", ", options_.capacity.jobs, " at once")
                               : absl::StrCat(" on ", options_.capacity.cores, " cores"),
                           "; Ctrl-C stops and saves\nrun folder: ", run_dir_));
}

// True where the cell needs no run, or may have none.
bool ExperimentRun::Settle(Entry* entry, const CellStanding& standing) {
  if (standing.state == CellState::kDone) {
    entry->outcome = Outcome::kDone;
    durations_.Add(entry->cell, absl::Seconds(standing.summary.wall_s));
    return true;
  }
  const bool changed = standing.state == CellState::kChanged && !options_.overwrite_changed;
  if (!changed && standing.state != CellState::kBusy) return false;
  entry->outcome = Outcome::kLeftAlone;
  std::string text = absl::StrCat("left alone: ", entry->cell.name(), ": run folder ");
  if (changed) {
    absl::StrAppend(&text, "of another config, which differs in (before -> now):\n", standing.difference,
                    "  ", entry->cell.folder,
                    "\n  --overwrite-changed moves it aside and starts anew; so does another --run-dir");
  } else {
    absl::StrAppend(&text, entry->cell.folder, " is in use by another launch");
  }
  screen_.Say(text);
  return true;
}

void ExperimentRun::StartDue() {
  while (const std::optional<std::size_t> next = schedule_->Next()) {
    Entry* entry = &entries_[*next];
    if (entry->outcome == Outcome::kWaiting) {
      if (const absl::Status status = Start(entry); !status.ok()) Fail(entry, std::string(status.message()));
    }
    if (entry->outcome == Outcome::kRunning) {
      running_[entry->cell.name()] = *next;
    } else {
      schedule_->Finish(*next);
    }
  }
}

// Looks again first: hours may have passed since the survey.
absl::Status ExperimentRun::Start(Entry* entry) {
  const Cell& cell = entry->cell;
  const CellStanding standing = ReadStanding(cell);
  if (Settle(entry, standing)) return absl::OkStatus();
  const bool resume = standing.state == CellState::kInterrupted || standing.state == CellState::kFailed;
  entry->before = resume ? standing.summary : RunSummary();
  if (!resume) {
    RETURN_IF_ERROR(CheckSeedBufferIsThere(cell));
    ASSIGN_OR_RETURN(const std::string aside, MoveAside(cell, run_dir_));
    if (!aside.empty()) screen_.Say(absl::StrCat(cell.name(), ": what was there is now in ", aside));
  }
  RETURN_IF_ERROR(PrepareCell(cell));
  RETURN_IF_ERROR(Launch(cell, resume));
  entry->outcome = Outcome::kRunning;
  entry->started = MonotonicNow();
  screen_.Say(absl::StrCat(resume ? "continuing " : "started ", cell.name()));
  return absl::OkStatus();
}

absl::Status ExperimentRun::Launch(const Cell& cell, bool resume) {
  ProcessSpec process;
  process.name = cell.name();
  process.command = {absl::StrCat(options_.programs, "/dbr"), "launch"};
  // A run that goes on does so under its own config, which says the same.
  process.command.push_back(resume ? "--resume" : cell.config_file());
  process.command.insert(process.command.end(), {"--run-dir", cell.folder});
  process.log = cell.log();
  process.stop_grace = kStopGrace;
  process.once = true;
  return supervisor_->Start(std::move(process));
}

void ExperimentRun::TakeEnded() {
  for (const EndedProcess& ended : supervisor_->TakeEnded()) {
    const auto found = running_.find(ended.name);
    const std::size_t index = found->second;
    running_.erase(found);
    schedule_->Finish(index);
    Judge(&entries_[index], ended);
  }
}

void ExperimentRun::Judge(Entry* entry, const EndedProcess& ended) {
  const Cell& cell = entry->cell;
  const CellStanding standing = ReadStanding(cell);
  if (ended.wait_status == 0 && standing.state == CellState::kDone) {
    const absl::Duration took = MonotonicNow() - entry->started;
    entry->outcome = Outcome::kDone;
    durations_.Add(cell, took + absl::Seconds(entry->before.wall_s));
    screen_.Say(absl::StrCat("done ", cell.name(), " in ", Clock(took), ": ", ResultText(standing.summary)));
    if (options_.keep_stores) return;
    if (const absl::Status removed = RemoveStores(cell); !removed.ok())
      screen_.Say(std::string(removed.message()));
    return;
  }
  if (supervisor_->stop_signals() > 0 && WasStopped(ended.wait_status)) {
    entry->outcome = Outcome::kWaiting;
    if (WIFSIGNALED(ended.wait_status))
      screen_.Say(absl::StrCat("killed ", cell.name(), ": it goes on from its last checkpoint"));
    return;
  }
  const std::string words = LogTail(cell.log(), ended.log_start, kLastLines);
  Fail(entry,
       absl::StrCat(ended.wait_status == 0 ? "ended without final results" : DescribeExit(ended.wait_status),
                    words.empty() ? ", saying nothing" : absl::StrCat(", its last lines:\n", words)));
}

void ExperimentRun::Fail(Entry* entry, const std::string& why) {
  entry->outcome = Outcome::kFailed;
  screen_.Say(absl::StrCat("FAILED ", entry->cell.name(), ": ", why, "\n  whole log: ", entry->cell.log()));
}

void ExperimentRun::ReadProgress() {
  for (const auto& [name, index] : running_) {
    Entry& entry = entries_[index];
    const RunFolder folder{entry.cell.folder};
    std::error_code missing;
    const auto written = std::filesystem::last_write_time(folder.summary(), missing);
    if (missing || written == entry.read_at) continue;
    entry.read_at = written;
    RunSummary summary = ReadSummary(folder);
    if (summary.launches > entry.before.launches) entry.newest = std::move(summary);
  }
}

GridStatus ExperimentRun::State() const {
  GridStatus state;
  for (const auto& [name, index] : running_)
    state.running.push_back({name, ProgressOf(entries_[index].cell.config, entries_[index].newest)});
  state.all = static_cast<int>(entries_.size());
  state.done = Count(Outcome::kDone);
  state.waiting = Count(Outcome::kWaiting);
  state.failed = Count(Outcome::kFailed);
  state.left_alone = Count(Outcome::kLeftAlone);
  state.left = TimeLeft();
  return state;
}

// By the finished cells and what the running ones will have taken; empty while a cell has nothing like it
// among these.
std::optional<absl::Duration> ExperimentRun::TimeLeft() const {
  CellDurations known = durations_;
  std::vector<RunningCell> running;
  for (const auto& [name, index] : running_) {
    const Entry& entry = entries_[index];
    const absl::Duration took = absl::Seconds(entry.before.wall_s) + (MonotonicNow() - entry.started);
    const std::optional<absl::Duration> expected = durations_.Expected(entry.cell);
    std::optional<absl::Duration> left = ProgressOf(entry.cell.config, entry.newest).left;
    if (left.has_value()) known.Add(entry.cell, took + *left);
    if (!left.has_value() && expected.has_value()) left = std::max(*expected - took, absl::ZeroDuration());
    if (!left.has_value()) return std::nullopt;
    running.push_back({index, *left});
  }
  std::vector<absl::Duration> durations(entries_.size());
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (entries_[i].outcome != Outcome::kWaiting) continue;
    const std::optional<absl::Duration> expected = known.Expected(entries_[i].cell);
    if (!expected.has_value()) return std::nullopt;
    durations[i] = std::max(*expected - absl::Seconds(entries_[i].before.wall_s), absl::ZeroDuration());
  }
  return TimeToFinish(*schedule_, running, durations);
}

int ExperimentRun::Count(Outcome outcome) const {
  return static_cast<int>(std::count_if(entries_.begin(), entries_.end(),
                                        [outcome](const Entry& entry) { return entry.outcome == outcome; }));
}

int ExperimentRun::Conclude(bool signalled) {
  screen_.End();
  const int failed = Count(Outcome::kFailed), left_alone = Count(Outcome::kLeftAlone);
  const int waiting = Count(Outcome::kWaiting);
  std::string text =
      absl::StrCat(title_, ": ", Count(Outcome::kDone), " of ", entries_.size(), " cells done");
  if (failed > 0) absl::StrAppend(&text, ", ", failed, " failed");
  if (left_alone > 0) absl::StrAppend(&text, ", ", left_alone, " left alone");
  if (waiting > 0) absl::StrAppend(&text, ", ", waiting, " still to run; the same command goes on");
  for (const Entry& entry : entries_) {
    if (entry.outcome == Outcome::kFailed) absl::StrAppend(&text, "\n  failed: ", entry.cell.log());
  }
  screen_.Say(absl::StrCat(text, "\nrun folder: ", run_dir_));
  if (signalled && waiting > 0) return kInterruptedExit;
  return failed > 0 || left_alone > 0 ? 1 : 0;
}

}  // namespace dbr
