#include "proto/config/experiment_file.h"

#include <vector>

#include "core/file_io.h"
#include "core/status_macros.h"
#include "proto/config/config_check.h"
#include "proto/config/config_text.h"

namespace dbr {
namespace {

absl::StatusOr<Experiment> Parse(absl::string_view text, const std::string& source) {
  Experiment experiment;
  std::vector<std::string> errors;
  ReadText(text, "", &experiment, &errors);
  FindViolations(experiment, "", &errors);
  RETURN_IF_ERROR(AllErrors(errors, source));
  return experiment;
}

}  // namespace

absl::StatusOr<Experiment> LoadExperiment(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  return Parse(text, path);
}

absl::StatusOr<Experiment> ParseExperiment(absl::string_view text) {
  return Parse(text, "experiment");
}

}  // namespace dbr
