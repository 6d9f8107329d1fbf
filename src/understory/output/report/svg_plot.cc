#include "understory/output/report/svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace understory {
namespace {

constexpr double kLeft = 58.0;
constexpr double kRight = 14.0;
constexpr double kTop = 12.0;
constexpr double kBottom = 42.0;
constexpr int kWidestFigure = 640;  // units that fit beside something else

// The drawing area of a plot and where a value lies in it.
struct Frame {
  double x_low = 0.0, x_high = 1.0, y_low = 0.0, y_high = 1.0;
  double width = 0.0, height = 0.0;
  bool logarithmic = false;  // limits are powers of ten then

  // Whether a value has a place.
  [[nodiscard]] bool holds(double x, double y) const {
    return std::isfinite(y) && (!logarithmic || (x > 0.0 && y > 0.0));
  }
  [[nodiscard]] double x(double value) const {
    if (logarithmic) value = std::log10(value);
    return kLeft + (value - x_low) / (x_high - x_low) * (width - kLeft - kRight);
  }
  [[nodiscard]] double y(double value) const {
    if (logarithmic) value = std::log10(value);
    return height - kBottom - (value - y_low) / (y_high - y_low) * (height - kTop - kBottom);
  }
};

std::string text_at(double x, double y, const char* anchor, const std::string& text,
                    const char* more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" {}>{}</text>", x, y,
                     anchor, more, escape_html(text));
}

// Short, as there is little room beside the axis.
std::string power_text(double power) {
  return std::abs(power) > 3.0 ? fmt::format("1e{:.0f}", power)
                               : fmt::format("{:g}", std::pow(10.0, power));
}

// Powers of ten on both axes.
std::string logarithmic_ticks(const Frame& frame) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  for (double power = frame.y_low; power <= frame.y_high; ++power) {
    const double y = frame.y(std::pow(10.0, power));
    fmt::format_to(out,
                   "<line class=\"grid\" x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/>",
                   kLeft, frame.width - kRight, y, y);
    svg += text_at(kLeft - 6, y + 4, "end", power_text(power));
  }
  for (double power = frame.x_low; power <= frame.x_high; ++power) {
    const double x = frame.x(std::pow(10.0, power));
    fmt::format_to(
        out, "<line class=\"grid\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\"/>",
        x, kTop, frame.height - kBottom);
    svg += text_at(x, frame.height - kBottom + 17, "middle", power_text(power));
  }
  return svg;
}

std::string even_ticks(const Frame& frame) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  const std::vector<double> y_ticks = round_ticks(frame.y_low, frame.y_high, 5);
  const double y_step = y_ticks.size() > 1 ? y_ticks[1] - y_ticks[0] : 1.0;
  for (const double tick : y_ticks) {
    fmt::format_to(out,
                   "<line class=\"grid\" x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/>",
                   kLeft, frame.width - kRight, frame.y(tick), frame.y(tick));
    svg += text_at(kLeft - 6, frame.y(tick) + 4, "end", tick_text(tick, y_step));
  }
  const std::vector<double> x_ticks = round_ticks(frame.x_low, frame.x_high, 8);
  const double x_step = x_ticks.size() > 1 ? x_ticks[1] - x_ticks[0] : 1.0;
  for (const double tick : x_ticks) {
    fmt::format_to(
        out, "<line class=\"axis\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\"/>",
        frame.x(tick), frame.height - kBottom, frame.height - kBottom + 4);
    svg += text_at(frame.x(tick), frame.height - kBottom + 17, "middle", tick_text(tick, x_step));
  }
  return svg;
}

std::string axes(const Frame& frame, const std::string& x_label, const std::string& y_label) {
  std::string svg = frame.logarithmic ? logarithmic_ticks(frame) : even_ticks(frame);
  const auto out = std::back_inserter(svg);
  fmt::format_to(out, "<path class=\"axis\" d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\"/>", kLeft, kTop,
                 frame.height - kBottom, frame.width - kRight);
  svg += text_at(0.5 * (kLeft + frame.width - kRight), frame.height - 6, "middle", x_label);
  const double middle = 0.5 * (kTop + frame.height - kBottom);
  svg += text_at(14, middle, "middle", y_label,
                 fmt::format("transform=\"rotate(-90 14 {:.1f})\"", middle).c_str());
  return svg;
}

std::string opened(int width, int height, const std::string& label) {
  return fmt::format("<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">",
                     width, height, escape_html(label));
}

std::string drawn(const PlotSeries& series, const Frame& frame) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  if (series.dots) {
    for (const auto& [x, y] : series.points) {
      if (!frame.holds(x, y)) continue;
      fmt::format_to(out, "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.2\" fill=\"{}\"/>", frame.x(x),
                     frame.y(frame.logarithmic ? y : std::min(y, frame.y_high)), series.colour);
    }
    return svg;
  }
  fmt::format_to(out, "<path class=\"line\" stroke=\"{}\" d=\"", series.colour);
  bool pen = false;
  for (const auto& [x, y] : series.points) {
    if (!frame.holds(x, y)) {
      pen = false;
      continue;
    }
    fmt::format_to(out, "{}{:.1f} {:.1f}", pen ? 'L' : 'M', frame.x(x),
                   frame.y(frame.logarithmic ? y : std::clamp(y, frame.y_low, frame.y_high)));
    pen = true;
  }
  return svg + "\"/>";
}

// The whole powers of ten around all values.
Frame logarithmic_frame_of(const Plot& plot) {
  Frame frame;
  frame.logarithmic = true;
  frame.width = plot.width;
  frame.height = plot.height;
  constexpr double kFar = 300.0;
  frame.x_low = frame.y_low = kFar;
  frame.x_high = frame.y_high = -kFar;
  for (const PlotSeries& series : plot.series) {
    for (const auto& [x, y] : series.points) {
      if (!(x > 0.0 && y > 0.0)) continue;
      frame.x_low = std::min(frame.x_low, std::floor(std::log10(x)));
      frame.x_high = std::max(frame.x_high, std::ceil(std::log10(x)));
      frame.y_low = std::min(frame.y_low, std::floor(std::log10(y)));
      frame.y_high = std::max(frame.y_high, std::ceil(std::log10(y)));
    }
  }
  if (frame.x_low >= frame.x_high) frame.x_high = frame.x_low + 1.0;
  if (frame.y_low >= frame.y_high) frame.y_high = frame.y_low + 1.0;
  return frame;
}

Frame frame_of(const Plot& plot) {
  if (plot.logarithmic) return logarithmic_frame_of(plot);
  Frame frame;
  frame.width = plot.width;
  frame.height = plot.height;
  constexpr double kFar = std::numeric_limits<double>::max();
  double x_low = kFar;
  double x_high = -kFar;
  double y_high = plot.y_min;
  for (const PlotSeries& series : plot.series) {
    for (const auto& [x, y] : series.points) {
      x_low = std::min(x_low, x);
      x_high = std::max(x_high, x);
      if (std::isfinite(y)) y_high = std::max(y_high, y);
    }
  }
  for (const PlotLevel& level : plot.levels)
    y_high = std::max(y_high, level.y);
  frame.x_low = x_low < x_high ? x_low : 0.0;
  frame.x_high = x_low < x_high ? x_high : 1.0;
  frame.y_low = plot.y_min;
  frame.y_high = plot.y_max > plot.y_min ? plot.y_max : plot.y_min + 1.08 * (y_high - plot.y_min);
  if (!(frame.y_high > frame.y_low)) frame.y_high = frame.y_low + 1.0;
  return frame;
}

}  // namespace

std::string escape_html(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::vector<double> round_ticks(double low, double high, int wanted) {
  const double rough = (high - low) / wanted;
  if (!(rough > 0.0)) return {low};
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= 0.7 * rough) {
      step = factor * power;
      break;
    }
  }
  std::vector<double> ticks;
  for (double i = std::ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; ++i)
    ticks.push_back(i * step + 0.0);
  return ticks;
}

std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 6);
  return fmt::format("{:.{}f}", std::abs(value) < 0.5 * step ? 0.0 : value, decimals);
}

std::vector<std::pair<double, double>> thinned_series(
    const std::vector<std::pair<double, double>>& points, std::size_t most) {
  if (points.size() <= most || most < 2) return points;
  const std::size_t parts = most / 2;
  std::vector<std::pair<double, double>> kept;
  for (std::size_t part = 0; part < parts; ++part) {
    const std::size_t begin = part * points.size() / parts;
    const std::size_t end = (part + 1) * points.size() / parts;
    const auto by_y = [](const auto& a, const auto& b) { return a.second < b.second; };
    const auto first = points.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = points.begin() + static_cast<std::ptrdiff_t>(end);
    auto [low, high] = std::minmax_element(first, last, by_y);
    if (low > high) std::swap(low, high);
    kept.push_back(*low);
    if (low != high) kept.push_back(*high);
  }
  return kept;
}

std::string svg_plot(const Plot& plot) {
  const Frame frame = frame_of(plot);
  // In a box of its own: on a narrow screen the plot keeps a size at which it can be read.
  std::string svg = "<div class=\"wide\">" +
                    opened(plot.width, plot.height, plot.y_label + " over " + plot.x_label);
  svg += axes(frame, plot.x_label, plot.y_label);
  for (const PlotSeries& series : plot.series)
    svg += drawn(series, frame);
  for (const PlotLevel& level : plot.levels) {
    svg += fmt::format(
        "<line class=\"level\" x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/>", kLeft,
        frame.width - kRight, frame.y(level.y), frame.y(level.y));
    svg += text_at(frame.width - kRight - 2, frame.y(level.y) - 4, "end", level.name);
  }
  double x = kLeft + 8.0;
  for (const PlotSeries& series : plot.series) {
    if (series.name.empty()) continue;
    svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"14\" height=\"4\" fill=\"{}\"/>", x,
                       kTop + 3, series.colour);
    svg += text_at(x + 18, kTop + 9, "start", series.name);
    x += 36.0 + 6.6 * static_cast<double>(series.name.size());
  }
  return svg + "</svg></div>";
}

std::string svg_histogram(const Histogram& histogram) {
  Frame frame;
  frame.width = histogram.width;
  frame.height = histogram.height;
  frame.x_low = histogram.first;
  frame.x_high = histogram.first + histogram.step * static_cast<double>(histogram.counts.size());
  int most = 1;
  for (const int count : histogram.counts)
    most = std::max(most, count);
  frame.y_high = 1.1 * most;
  // As a plot: one as wide as the page keeps its size on a narrow screen.
  const bool wide = histogram.width > kWidestFigure;
  std::string svg = wide ? "<div class=\"wide\">" : "";
  svg += opened(histogram.width, histogram.height, histogram.x_label);
  svg += axes(frame, histogram.x_label, histogram.y_label);
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    if (histogram.counts[i] == 0) continue;
    const double left = frame.x(histogram.first + histogram.step * static_cast<double>(i));
    const double right = frame.x(histogram.first + histogram.step * static_cast<double>(i + 1));
    svg += fmt::format(
        "<rect class=\"bar\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"><title>{}"
        "</title></rect>",
        left + 1, frame.y(histogram.counts[i]), std::max(1.0, right - left - 2),
        frame.y(0) - frame.y(histogram.counts[i]), histogram.counts[i]);
  }
  return svg + (wide ? "</svg></div>" : "</svg>");
}

}  // namespace understory
