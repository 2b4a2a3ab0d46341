// A whole run: processes, progress, the end and its table.
#pragma once

#include <spdlog/logger.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "deploy/launch/monitor.h"
#include "deploy/launch/progress.h"
#include "deploy/launch/run_plan.h"
#include "deploy/launch/run_summary.h"
#include "deploy/launch/run_watch.h"
#include "deploy/process/supervisor.h"
#include "deploy/terminal/output.h"
#include "envs/presentation.h"

namespace dbr {

// Runs one plan once, from the main thread. Everything that the user sees goes to `out`, which must outlive
// it. What it knows of the run is its RunWatch's; it starts and stops the processes, and tells.
class Launch {
 public:
  // `programs`: the folder of dbr-replay, dbr-learner and dbr-actor. Internal where the log cannot be opened.
  static absl::StatusOr<std::unique_ptr<Launch>> Create(RunPlan plan, std::string programs, Output* out);

  // Starts everything (the actors after the offline phase), trains until a limit of the config or a signal,
  // stops everything with its state saved, and evaluates the last policy. Blocks. Returns the exit status, 0
  // or after a signal 130, or the first failure.
  absl::StatusOr<int> Run();

 private:
  Launch(RunPlan plan, std::string programs, Output* out, std::shared_ptr<spdlog::logger> log);
  const RunSummary& summary() const { return watch_.summary(); }
  const EnvPresentation& presentation() const;

  void Announce();
  // In a resume: what of the run is no longer there.
  void TellWhatIsLost();
  // Services, and actors where there is no offline phase. Once the services serve, the run folder is this
  // launch's (FolderClaim::Begin). OK also where a stop signal came first.
  absl::Status StartAll();
  // The end of a launch whose services never served, of an error or (OK) a stop signal.
  absl::StatusOr<int> GiveUp(const absl::Status& why);
  absl::Status StartActors();
  absl::Status WaitUntilServing(const std::string& name, const std::string& address, absl::Duration within);
  void TellOfTheSeedBuffer();
  // Blocks until a limit or a stop signal.
  absl::Status Train();
  void Observe(const RunSample& sample, absl::Time now);
  // Writes the summary now and then. FailedPrecondition where the run folder has gone; other errors are
  // logged.
  absl::Status SaveIfDue(absl::Time now);

  struct Stopped {
    bool actors_ended = false;    // each by itself and without an error
    bool services_saved = false;  // the same of learner and replay: their state is on disk
    bool by_signal = false;       // a stop signal came, before or meanwhile
  };
  // `ask`: for what the services count last.
  Stopped StopAll(bool ask);
  // Tells and notes how the run ended, and evaluates the last policy. Returns what Run does.
  absl::StatusOr<int> Conclude(const Stopped& stopped);
  bool HasPolicy() const;
  absl::Status FinalEvaluation(bool* interrupted);
  void Say(const std::string& text);
  // Errors are those of the file.
  absl::Status SaveSummary();

  const RunPlan plan_;
  const std::string programs_;
  const std::shared_ptr<spdlog::logger> log_;
  ProgressLine line_;
  RunWatch watch_;
  bool acting_ = false;           // the actors were started
  bool said_finetuning_ = false;  // how the run goes on from its offline phase
  std::unique_ptr<Supervisor> supervisor_;
  std::unique_ptr<RunMonitor> monitor_;
};

}  // namespace dbr
