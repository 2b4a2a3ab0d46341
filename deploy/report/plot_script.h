// Plots in gnuplot's language, each into an SVG file. No text of a label is ever taken for a command.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "deploy/report/curves.h"

namespace dbr::report {

// How the script of all plots of a report begins, for one call of gnuplot; the plots follow.
std::string ScriptHead();

// A line with a band from least to greatest where it has two seeds or more. Contenders keep their style in
// all plots: a colour that colour-blind readers can tell apart, and past seven another dash.
struct Line {
  std::string label;
  int style = 0;
  Curve curve;
};

struct CurvePlot {
  std::string file;  // the SVG
  std::string title, x_label, y_label;
  std::vector<Line> lines;
  std::optional<double> reference;  // a dotted level across, with its label
  std::string reference_label;
};
// Empty where no line has a point.
std::string Script(const CurvePlot& plot);

struct Estimate {
  double value = 0;
  double low = std::numeric_limits<double>::quiet_NaN();  // NaN, and `high` too: no whisker
  double high = std::numeric_limits<double>::quiet_NaN();
};

// Two bars side by side: what was published, and ours.
struct Bar {
  std::string label;
  std::optional<Estimate> published, ours;
};

// Bars on one scale.
struct BarPanel {
  std::string title, y_label;
  std::vector<Bar> bars;
};

struct BarPlot {
  std::string file;  // the SVG
  std::string published_label, our_label;
  std::vector<BarPanel> panels;  // two in a line
};
// Empty where no bar has a value; panels without one are left out.
std::string Script(const BarPlot& plot);

}  // namespace dbr::report
