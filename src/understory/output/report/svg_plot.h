#pragma once

#include <string>
#include <utility>
#include <vector>

namespace understory {

// Small plots as inline SVG, with axes, units and a grid. Their colours are those of the page (CSS
// variables), so that they follow its light or dark dress.
struct PlotSeries {
  std::string name;                               // empty: no entry in the legend
  std::string colour = "var(--line)";             // CSS
  std::vector<std::pair<double, double>> points;  // x ascending; NaN breaks the line
  bool dots = false;                              // else a line
};
struct PlotLevel {
  std::string name;
  double y = 0.0;
};
struct Plot {
  std::string x_label;  // with unit
  std::string y_label;
  std::vector<PlotSeries> series;
  std::vector<PlotLevel> levels;  // horizontal lines with a name
  double y_min = 0.0;
  double y_max = 0.0;        // equal to y_min: from the data
  bool logarithmic = false;  // both axes; values above zero, y_min and y_max are not heeded
  int width = 720;
  int height = 240;
};
[[nodiscard]] std::string svg_plot(const Plot& plot);

// Bars over equal classes: left edge of the first class, width of a class, counts.
struct Histogram {
  std::string x_label;
  std::string y_label;
  double first = 0.0;
  double step = 1.0;
  std::vector<int> counts;
  int width = 480;
  int height = 240;
};
[[nodiscard]] std::string svg_histogram(const Histogram& histogram);

// At most `most` points of a long series: the lowest and highest of each of equal stretches, so
// that no peak is lost.
[[nodiscard]] std::vector<std::pair<double, double>> thinned_series(
    const std::vector<std::pair<double, double>>& points, std::size_t most);

// Round numbers that cut [low, high] into about `wanted` parts.
[[nodiscard]] std::vector<double> round_ticks(double low, double high, int wanted);
// The shortest decimal form of a tick at this step.
[[nodiscard]] std::string tick_text(double value, double step);
[[nodiscard]] std::string escape_html(const std::string& text);

}  // namespace understory
