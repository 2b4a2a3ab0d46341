#include "deploy/report/plot_script.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace dbr::report {
namespace {

// Okabe and Ito's palette for colour-blind readers, without its yellow, which is faint on white.
constexpr const char* kColours[] = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                    "#E69F00", "#56B4E9", "#000000"};
constexpr int kColourCount = 7;
constexpr const char* kDashes[] = {"1", "2", "4"};
constexpr int kDashCount = 3;
constexpr char kPublishedColour[] = "#BBBBBB";
constexpr double kBarWidth = 0.38;  // of the distance between two contenders

// Text between gnuplot's single quotes, where nothing but the quote itself has a meaning.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20) {
      quoted += ' ';
    } else {
      quoted += c == '\'' ? "''" : std::string(1, c);
    }
  }
  return quoted + "'";
}

std::string Begin(const std::string& file, int width, int height) {
  return absl::StrCat("\nreset\nset terminal svg size ", width, ",", height,
                      " fixed noenhanced font 'sans-serif,14' background '#ffffff'\nset output ",
                      Quoted(file),
                      "\nset border 3 lc rgb '#444444'\nset tics nomirror textcolor rgb '#222222'\n"
                      "set grid ytics lt 1 lw 0.5 lc rgb '#DDDDDD'\n");
}

std::string CurveData(const Curve& curve) {
  std::string text;
  for (std::size_t i = 0; i < curve.x.size(); ++i)
    absl::StrAppendFormat(&text, "%.7g %.6g %.6g %.6g\n", curve.x[i], curve.mean[i], curve.low[i],
                          curve.high[i]);
  return text;
}

// The elements of a plot command that draw line `i`; a curve of one point is a dot.
std::string BandOf(std::size_t i, const Line& line) {
  return absl::StrFormat(
      "$c%u using 1:3:4 with filledcurves fs transparent solid 0.18 noborder lc rgb '%s' notitle", i,
      kColours[line.style % kColourCount]);
}

std::string LineOf(std::size_t i, const Line& line) {
  const char* how = line.curve.x.size() == 1 ? "points pt 7 ps 0.8" : "lines lw 2.2";
  return absl::StrFormat("$c%u using 1:2 with %s dt %s lc rgb '%s' title %s", i, how,
                         kDashes[line.style / kColourCount % kDashCount], kColours[line.style % kColourCount],
                         Quoted(line.label));
}

bool HasBars(const BarPanel& panel) {
  return std::any_of(panel.bars.begin(), panel.bars.end(),
                     [](const Bar& bar) { return bar.published.has_value() || bar.ours.has_value(); });
}

// One side of the pairs of bars: the block of their values and the block of their whiskers.
struct Side {
  std::string bars, whiskers;
  void Add(std::size_t place, const std::optional<Estimate>& estimate) {
    if (!estimate.has_value()) return;
    absl::StrAppendFormat(&bars, "%u %.6g\n", place, estimate->value);
    if (std::isfinite(estimate->low))
      absl::StrAppendFormat(&whiskers, "%u %.6g %.6g\n", place, estimate->low,
                            estimate->high - estimate->low);
  }
  // Appends the blocks named after `name` to `data` and their elements to `elements`.
  void Draw(const std::string& name, double shift, const std::string& colour, const std::string& label,
            std::string* data, std::vector<std::string>* elements) const {
    if (bars.empty()) return;
    absl::StrAppend(data, "$", name, " << EOD\n", bars, "EOD\n");
    elements->push_back(
        absl::StrFormat("$%s using ($1%+.2f):2 with boxes fs solid 0.85 noborder lc rgb '%s' title %s", name,
                        shift, colour, Quoted(label)));
    if (whiskers.empty()) return;
    absl::StrAppend(data, "$w", name, " << EOD\n", whiskers, "EOD\n");
    elements->push_back(
        absl::StrFormat("$w%s using ($1%+.2f):2:(0):3 with vectors heads size screen 0.004,90 lw 1.3 lc rgb "
                        "'#222222' notitle",
                        name, shift));
  }
};

std::string PanelScript(const BarPlot& plot, const BarPanel& panel) {
  Side published, ours;
  std::vector<std::string> tics;
  for (std::size_t i = 0; i < panel.bars.size(); ++i) {
    published.Add(i, panel.bars[i].published);
    ours.Add(i, panel.bars[i].ours);
    tics.push_back(absl::StrCat(Quoted(panel.bars[i].label), " ", i));
  }
  const bool pairs = !published.bars.empty();
  std::string script;
  std::vector<std::string> elements;
  published.Draw("p", -kBarWidth / 2, kPublishedColour, plot.published_label, &script, &elements);
  ours.Draw("o", pairs ? kBarWidth / 2 : 0.0, kColours[0], plot.our_label, &script, &elements);
  absl::StrAppend(
      &script, "set title ", Quoted(panel.title), "\nset ylabel ", Quoted(panel.y_label), "\nset xtics (",
      absl::StrJoin(tics, ", "),
      ") rotate by 35 right scale 0\nset xrange [-0.6:", static_cast<double>(panel.bars.size()) - 0.4,
      "]\nplot ", absl::StrJoin(elements, ", "), "\n");
  return script;
}

}  // namespace

std::string ScriptHead() {
  return "set encoding utf8\n";
}

std::string Script(const CurvePlot& plot) {
  std::string data;
  std::vector<std::string> bands, lines;
  for (std::size_t i = 0; i < plot.lines.size(); ++i) {
    const Line& line = plot.lines[i];
    if (line.curve.x.empty()) continue;
    absl::StrAppend(&data, "$c", i, " << EOD\n", CurveData(line.curve), "EOD\n");
    if (line.curve.seeds > 1 && line.curve.x.size() > 1) bands.push_back(BandOf(i, line));
    lines.push_back(LineOf(i, line));
  }
  if (lines.empty()) return "";
  if (plot.reference.has_value()) {
    lines.push_back(absl::StrFormat("%.6g with lines lw 1.5 dt 3 lc rgb '#666666' title %s", *plot.reference,
                                    Quoted(plot.reference_label)));
  }
  bands.insert(bands.end(), lines.begin(), lines.end());  // lines lie over all bands
  return absl::StrCat(
      Begin(plot.file, 900, 430), data, "set title ", Quoted(plot.title), "\nset xlabel ",
      Quoted(plot.x_label), "\nset ylabel ", Quoted(plot.y_label),
      "\nset format x '%.0s%c'\nset key outside right top Left reverse samplen 2\nset xrange [0:*]\nplot ",
      absl::StrJoin(bands, ", \\\n  "), "\n");
}

std::string Script(const BarPlot& plot) {
  std::vector<const BarPanel*> panels;
  for (const BarPanel& panel : plot.panels) {
    if (HasBars(panel)) panels.push_back(&panel);
  }
  if (panels.empty()) return "";
  const int columns = panels.size() == 1 ? 1 : 2;
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  std::string script = absl::StrCat(
      Begin(plot.file, columns == 1 ? 620 : 1040, 380 * rows), "set multiplot layout ", rows, ",", columns,
      "\nset boxwidth ", kBarWidth, "\nset xzeroaxis lt 1 lw 1 lc rgb '#444444'\nset yrange [*<0:0<*]\n",
      "set key outside top center samplen 1 font ',12'\nset lmargin 11\nset rmargin 3\n");
  for (const BarPanel* panel : panels) script += PanelScript(plot, *panel);
  return script + "unset multiplot\n";
}

}  // namespace dbr::report
