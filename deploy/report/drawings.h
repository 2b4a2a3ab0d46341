// Collecting the pictures of a report.
#pragma once

#include <string>
#include <utility>

#include "absl/status/status.h"
#include "deploy/report/document.h"
#include "deploy/report/plot_script.h"

namespace dbr::report {

// What is to be drawn into a report's folder: all plots in one call of gnuplot.
class Drawings {
 public:
  // `folder` must have a folder "plots" in it.
  explicit Drawings(std::string folder) : folder_(std::move(folder)), script_(ScriptHead()) {}

  // Adds the plot as plots/NAME.svg to the document; false where it has nothing to show.
  bool Add(const std::string& name, const std::string& caption, CurvePlot plot, Document* document);
  bool Add(const std::string& name, const std::string& title, const std::string& caption, BarPlot plot,
           Document* document);
  // Writes an SVG of our own at once, and adds it to the document.
  absl::Status Add(const std::string& name, const std::string& title, const std::string& caption,
                   const std::string& svg, Document* document);

  // Draws everything in one call of gnuplot. Blocks. A plot that could not be drawn leaves no file, not even
  // one of an earlier report. See RunGnuplot for the errors.
  absl::Status Draw() const;

 private:
  std::string PathOf(const std::string& name) const;
  bool AddScript(const std::string& name, const std::string& title, const std::string& caption,
                 const std::string& script, Document* document);

  std::string folder_;
  std::string script_;
  bool has_plots_ = false;
};

}  // namespace dbr::report
