#include "deploy/cli/dataset_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/monotonic_clock.h"
#include "core/status_macros.h"
#include "deploy/cli/command_line.h"
#include "deploy/cli/common_options.h"
#include "deploy/terminal/progress_bar.h"
#include "deploy/terminal/terminal.h"
#include "replay/dataset/dataset_copy.h"

namespace dbr {
namespace {

constexpr int kChunk = 8192;  // transitions

struct InfoFlags {
  std::string path;
  std::string layout;
  bool json = false;
};

struct ConvertFlags {
  std::string in, out;
  std::string from, to;
  bool skip_bad_rows = false;
};

absl::StatusOr<int> RunInfo(const InfoFlags& flags) {
  ASSIGN_OR_RETURN(const std::optional<DatasetLayout> layout, ParseLayoutOption("--layout", flags.layout));
  const Interrupt interrupt;
  const absl::StatusOr<DatasetReport> report = ReportDataset(flags.path, layout, interrupt);
  if (absl::IsCancelled(report.status())) return kInterruptedExit;
  RETURN_IF_ERROR(report.status());
  std::printf("%s", flags.json ? (DatasetJson(*report).dump() + "\n").c_str() : DatasetText(*report).c_str());
  return 0;
}

absl::Status Convert(const ConvertFlags& flags, const Interrupt& interrupt) {
  ASSIGN_OR_RETURN(const std::optional<DatasetLayout> from, ParseLayoutOption("--layout", flags.from));
  ASSIGN_OR_RETURN(const std::optional<DatasetLayout> to, ParseLayoutOption("--to", flags.to));
  ASSIGN_OR_RETURN(
      const std::unique_ptr<DatasetReader> reader,
      DatasetReader::Open(
          flags.in, {.layout = from, .skip_bad_rows = flags.skip_bad_rows, .cancelled = &interrupt.flag()}));
  DatasetWriterOptions options{.layout = *to, .env = {}};
  options.env.name = reader->env();
  options.env.observation_size = reader->transition_layout().observation_width;
  options.env.actions = {ActionKind::kContinuous, reader->transition_layout().action_width};
  options.env.max_episode_steps = reader->max_episode_steps();
  ASSIGN_OR_RETURN(const std::unique_ptr<DatasetWriter> writer, DatasetWriter::Create(flags.out, options));
  BarState state;
  state.label = absl::StrCat(DatasetLayoutName(reader->layout()), " to ", flags.to);
  state.unit = "rows";
  state.total = reader->facts().rows;
  ProgressBar bar(stderr, state, MonotonicNow(), kProgressEvery);
  RETURN_IF_ERROR(CopyDataset(reader.get(), writer.get(), [&](std::int64_t transitions) {
    bar.Update(transitions, MonotonicNow());
    return !interrupt.flag();
  }));
  return writer->Finish();
}

absl::StatusOr<int> RunConvert(const ConvertFlags& flags) {
  const Interrupt interrupt;
  const absl::Status converted = Convert(flags, interrupt);
  if (absl::IsCancelled(converted)) return kInterruptedExit;
  RETURN_IF_ERROR(converted);
  const absl::StatusOr<DatasetReport> report = ReportDataset(flags.out, std::nullopt, interrupt);
  if (absl::IsCancelled(report.status())) return kInterruptedExit;
  RETURN_IF_ERROR(report.status());
  std::printf("%s", DatasetText(*report).c_str());
  return 0;
}

void AddInfo(CLI::App* dataset, int* exit_code) {
  auto flags = std::make_shared<InfoFlags>();
  CLI::App* command =
      dataset->add_subcommand("info", "Show what a file holds: rows, episodes, returns, bad rows");
  command->add_option("FILE", flags->path, "HDF5 file, or folder of a Minari dataset")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--layout", flags->layout, "Layout of the file [as the file itself says; never guessed]")
      ->type_name(kLayoutNames);
  command->add_flag("--json", flags->json,
                    "Print one JSON object: {layout, rows, transitions, episodes, terminals, timeouts, "
                    "non_finite, bad_flags, "
                    "return: {mean, std, min, max}, actions_outside, warnings}");
  command->footer("Example: dbr dataset info hopper_medium.hdf5 --layout d4rl_pybullet");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunInfo(*flags);
    *exit_code = result.ok() ? *result : Fail("dataset info", result.status());
  });
}

void AddConvert(CLI::App* dataset, int* exit_code) {
  auto flags = std::make_shared<ConvertFlags>();
  CLI::App* command = dataset->add_subcommand("convert", "Write a file's transitions in another layout");
  command->add_option("IN", flags->in, "HDF5 file, or folder of a Minari dataset")
      ->required()
      ->type_name("FILE");
  command->add_option("--layout", flags->from, "Layout of IN [as the file itself says; never guessed]")
      ->type_name(kLayoutNames);
  command->add_option("--to", flags->to, "Layout of the file to write")
      ->required()
      ->type_name(kWrittenLayoutNames);
  command
      ->add_option("--out", flags->out,
                   "The HDF5 file to write; an old one is replaced when the new one is whole")
      ->required()
      ->type_name("FILE");
  command->add_flag("--skip-bad-rows", flags->skip_bad_rows,
                    "Leave out rows with a value that is not finite, or a flag neither 0 nor 1");
  command->footer(
      "Example: dbr dataset convert published.hdf5 --layout d4rl_pybullet --to d4rl --out hopper.hdf5");
  command->callback([flags, exit_code] {
    const absl::StatusOr<int> result = RunConvert(*flags);
    *exit_code = result.ok() ? *result : Fail("dataset convert", result.status());
  });
}

}  // namespace

absl::StatusOr<std::optional<DatasetLayout>> ParseLayoutOption(const std::string& option,
                                                               const std::string& name) {
  if (name.empty()) return std::nullopt;
  const absl::StatusOr<DatasetLayout> layout = ParseDatasetLayout(name);
  if (layout.ok()) return *layout;
  return absl::InvalidArgumentError(absl::StrCat(option, ": ", layout.status().message()));
}

absl::StatusOr<DatasetReport> ReportDataset(const std::string& path, std::optional<DatasetLayout> layout,
                                            const Interrupt& interrupt) {
  ASSIGN_OR_RETURN(
      const std::unique_ptr<DatasetReader> reader,
      DatasetReader::Open(path, {.layout = layout, .skip_bad_rows = true, .cancelled = &interrupt.flag()}));
  TransitionChunk chunk(reader->transition_layout(), kChunk);
  while (true) {
    ASSIGN_OR_RETURN(const int size, reader->Next(&chunk));
    if (size == 0) break;
  }
  return DatasetReport{
      .path = reader->path(), .env = reader->env(), .layout = reader->layout(), .facts = reader->facts()};
}

void AddDataset(CLI::App* app, int* exit_code) {
  CLI::App* dataset =
      app->add_subcommand("dataset", "Record, examine and convert offline data in HDF5 files");
  dataset->require_subcommand(1);
  AddDatasetRecord(dataset, exit_code);
  AddInfo(dataset, exit_code);
  AddConvert(dataset, exit_code);
}

}  // namespace dbr
