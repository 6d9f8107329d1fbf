#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"

namespace understory {
namespace {

constexpr double kAxisWidth = 52.0;
constexpr double kAxisHeight = 40.0;
constexpr double kMostWidth = 900.0;
constexpr double kMostHeight = 700.0;
constexpr double kMarginM = 2.0;
constexpr std::size_t kMostArrows = 4000;
constexpr std::size_t kMostPathPoints = 2000;
// A mean arrow of fewer units cannot be seen.
constexpr double kSeen = 10.0;

// From the plane of the maps to the units of the picture, alike along both axes.
struct FieldView {
  Eigen::Vector2d low = Eigen::Vector2d::Zero();
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
  double scale = 1.0;  // units per metre
  [[nodiscard]] double width() const { return (high.x() - low.x()) * scale; }
  [[nodiscard]] double height() const { return (high.y() - low.y()) * scale; }
  [[nodiscard]] Eigen::Vector2d at(const Eigen::Vector2d& point) const {
    return {kAxisWidth + (point.x() - low.x()) * scale, (high.y() - point.y()) * scale};
  }
};

FieldView view_of(const ReportDeformation& field) {
  FieldView view;
  view.low = view.high = field.arrows.front().at;
  const auto hold = [&](const Eigen::Vector2d& point) {
    view.low = view.low.cwiseMin(point);
    view.high = view.high.cwiseMax(point);
  };
  for (const ReportDeformation::Arrow& arrow : field.arrows)
    hold(arrow.at);
  for (const auto* path : {&field.path_of_first, &field.path_of_second})
    std::for_each(path->begin(), path->end(), hold);
  view.low.array() -= kMarginM;
  view.high.array() += kMarginM;
  const Eigen::Vector2d size = view.high - view.low;
  view.scale = std::min(kMostWidth / size.x(), kMostHeight / size.y());
  return view;
}

// How much longer than true the arrows are drawn, a round number.
double enlargement(const ReportDeformation& field, double scale) {
  double sum_m = 0.0;
  for (const ReportDeformation::Arrow& arrow : field.arrows)
    sum_m += arrow.by.norm();
  const double mean = scale * sum_m / static_cast<double>(field.arrows.size());
  double factor = 1.0;
  for (const double larger : {2.0, 5.0, 10.0, 20.0, 50.0, 100.0})
    if (mean * factor < kSeen) factor = larger;
  return factor;
}

std::string axes(const FieldView& view) {
  std::string svg = fmt::format(
      "<rect x=\"{:.1f}\" y=\"0\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
      "stroke=\"var(--rule)\"/>",
      kAxisWidth, view.width(), view.height());
  const auto ticks = [](double low, double high) {
    const int wanted = std::clamp(static_cast<int>((high - low) / 10.0), 2, 8);
    std::vector<double> at = round_ticks(low, high, wanted);
    std::erase_if(at, [&](double tick) { return tick < low || tick > high; });
    return at;
  };
  for (const double tick : ticks(view.low.x(), view.high.x()))
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{:g}</text>",
                       view.at({tick, 0.0}).x(), view.height() + 16.0, tick);
  for (const double tick : ticks(view.low.y(), view.high.y()))
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{:g}</text>",
                       kAxisWidth - 5.0, view.at({0.0, tick}).y() + 4.0, tick);
  svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">x, m</text>",
                     kAxisWidth + 0.5 * view.width(), view.height() + 34.0);
  return svg + fmt::format(
                   "<text transform=\"translate(12 {:.1f}) rotate(-90)\" "
                   "text-anchor=\"middle\">y, m</text>",
                   0.5 * view.height());
}

// All arrows as one path: shaft, and a head of a third of it.
std::string arrows(const ReportDeformation& field, const FieldView& view, double factor) {
  std::string way;
  const std::size_t stride = (field.arrows.size() + kMostArrows - 1) / kMostArrows;
  for (std::size_t k = 0; k < field.arrows.size(); k += stride) {
    const ReportDeformation::Arrow& arrow = field.arrows[k];
    const Eigen::Vector2d from = view.at(arrow.at);
    const Eigen::Vector2d to = view.at(arrow.at + factor * arrow.by);
    const Eigen::Vector2d back = 0.3 * (from - to);
    const Eigen::Vector2d side(-0.5 * back.y(), 0.5 * back.x());
    way += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}M{:.1f} {:.1f}L{:.1f} {:.1f}",
                       from.x(), from.y(), to.x(), to.y(), (to + back + side).x(),
                       (to + back + side).y(), to.x(), to.y(), (to + back - side).x(),
                       (to + back - side).y());
  }
  return "<path class=\"field\" d=\"" + way + "\" fill=\"none\" stroke=\"var(--line)\"/>";
}

std::string path_of(const std::vector<Eigen::Vector2d>& path, const FieldView& view,
                    const char* colour) {
  if (path.size() < 2) return "";
  const std::size_t stride = (path.size() + kMostPathPoints - 1) / kMostPathPoints;
  std::string way;
  for (std::size_t k = 0; k < path.size(); k += stride) {
    const Eigen::Vector2d at = view.at(path[k]);
    way += fmt::format("{}{:.1f} {:.1f}", way.empty() ? 'M' : 'L', at.x(), at.y());
  }
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>", way,
                     colour);
}

std::string legend(const ReportDeformation& field) {
  const auto entry = [](const char* colour, const char* text) {
    return fmt::format("<span style=\"color:{}\">&#9644;</span> {}. ", colour, text);
  };
  std::string text;
  if (!field.path_of_first.empty()) text += entry("var(--text)", "Path of the first map");
  if (!field.path_of_second.empty())
    text += entry("var(--bad)", "Path of the second map") +
            entry("var(--good)", "The same path, moved as the trees beside it");
  return text;
}

}  // namespace

std::string deformation_section(const ReportInput& input) {
  if (!input.deformation || input.deformation->arrows.empty()) return "";
  const ReportDeformation& field = *input.deformation;
  const FieldView view = view_of(field);
  const double factor = enlargement(field, view.scale);
  const std::string size = factor > 1.0
                               ? fmt::format("drawn {:.0f} times as long as they are", factor)
                               : "drawn to scale";
  std::string html = fmt::format(
      "<section><h2>How far the two maps are apart</h2><p>Each arrow leads from a tree of the "
      "second map towards its place in the first map. Arrows are {}. Trees that both maps hold "
      "were {:.2f} m apart in the mean.</p>",
      size, field.mean_m);
  html += fmt::format(
      "<figure><svg class=\"plot\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" "
      "aria-label=\"arrows from the second map to the first\">",
      kAxisWidth + view.width() + 10.0, view.height() + kAxisHeight);
  html += axes(view) + arrows(field, view, factor) +
          path_of(field.path_of_first, view, "var(--text)") +
          path_of(field.path_of_second, view, "var(--bad)") +
          path_of(field.moved_path_of_second, view, "var(--good)");
  return html + "</svg><figcaption>" + legend(field) +
         "The values of all arrows are in deformation.csv.</figcaption></figure></section>\n";
}

}  // namespace understory
