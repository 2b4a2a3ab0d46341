#include "deploy/report/drawings.h"

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/file_io.h"
#include "core/status_macros.h"
#include "deploy/process/gnuplot.h"

namespace dbr::report {
namespace {

constexpr absl::Duration kDrawingDeadline = absl::Minutes(5);

}  // namespace

std::string Drawings::PathOf(const std::string& name) const {
  return absl::StrCat(folder_, "/plots/", name, ".svg");
}

bool Drawings::AddScript(const std::string& name, const std::string& title, const std::string& caption,
                         const std::string& script, Document* document) {
  if (script.empty()) return false;
  std::error_code ignored;
  std::filesystem::remove(PathOf(name), ignored);  // of an earlier report
  script_ += script;
  has_plots_ = true;
  document->Add(Picture{absl::StrCat("plots/", name, ".svg"), title, caption});
  return true;
}

bool Drawings::Add(const std::string& name, const std::string& caption, CurvePlot plot, Document* document) {
  plot.file = PathOf(name);
  return AddScript(name, plot.title, caption, Script(plot), document);
}

bool Drawings::Add(const std::string& name, const std::string& title, const std::string& caption,
                   BarPlot plot, Document* document) {
  plot.file = PathOf(name);
  return AddScript(name, title, caption, Script(plot), document);
}

absl::Status Drawings::Add(const std::string& name, const std::string& title, const std::string& caption,
                           const std::string& svg, Document* document) {
  RETURN_IF_ERROR(WriteFileAtomically(PathOf(name), svg));
  document->Add(Picture{absl::StrCat("plots/", name, ".svg"), title, caption});
  return absl::OkStatus();
}

absl::Status Drawings::Draw() const {
  return has_plots_ ? RunGnuplot(script_, folder_, kDrawingDeadline) : absl::OkStatus();
}

}  // namespace dbr::report
