#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "understory/output/report/png.h"
#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"

namespace understory {
namespace {

constexpr std::uint8_t kRed = 255;
constexpr int kPairGreys = 250;

// Colour 1 white to colour 250 black, and red.
PalettePicture grey_picture(int width, int height) {
  PalettePicture picture;
  picture.width = width;
  picture.height = height;
  picture.palette.resize(256);
  for (int k = 0; k < kPairGreys; ++k) {
    const auto grey = static_cast<std::uint8_t>(252 - k);
    picture.palette[static_cast<std::size_t>(k) + 1] = {grey, grey, grey};
  }
  picture.palette[kRed] = {0xd6, 0x6a, 0x5c};
  picture.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  return picture;
}

std::uint8_t grey(double share) {
  return static_cast<std::uint8_t>(
      1 + std::clamp(static_cast<int>(share * kPairGreys), 0, kPairGreys - 1));
}

std::string image(const PalettePicture& picture, double x, double y, double width, double height) {
  return fmt::format(
      "<image x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
      "preserveAspectRatio=\"none\" style=\"image-rendering:pixelated\" "
      "href=\"data:image/png;base64,{}\"/>",
      x, y, width, height, base64(encode_png(picture)));
}

std::string figure(const std::string& svg, const std::string& caption) {
  return "<figure>" + svg + "<figcaption>" + caption + "</figcaption></figure>";
}

// P0 figure 9.
std::string pair_scatter(const ReportCorrection& correction) {
  Plot plot;
  plot.x_label = "share of their sectors that two views have in common";
  plot.y_label = "mean distance of their stems, m";
  plot.width = 1100;
  plot.height = 320;
  plot.y_max = 1.5;
  PlotSeries good{"worth matching again", "var(--good)", {}, true};
  PlotSeries poor{"not worth it", "var(--soft)", {}, true};
  for (const ReportPair& pair : correction.pairs)
    (pair.acceptable ? good : poor)
        .points.emplace_back(pair.overlap, std::min(pair.error_m, plot.y_max));
  for (PlotSeries* series : {&poor, &good}) {
    std::sort(series->points.begin(), series->points.end());
    if (!series->points.empty()) plot.series.push_back(*series);
  }
  PlotSeries line{"limit", "var(--bad)", {}, false};
  for (const double overlap : {0.0, 1.0}) {
    line.points.emplace_back(
        overlap, correction.acceptable_m + overlap * correction.acceptable_per_overlap_m);
  }
  plot.series.push_back(line);
  return "<h3>Pairs of views before the correction</h3>" + svg_plot(plot) +
         fmt::format(
             "<p class=\"so\">{} pairs drawn at random. Those below the line with more than {:.2f} "
             "in common are worth matching again.</p>",
             correction.pairs.size(), correction.min_overlap);
}

// Ticks and names of both axes of a matrix: views are counted from 0 at the upper left corner.
std::string matrix_axes(int views, double left, double side) {
  std::string svg;
  const double scale = side / std::max(1, views);
  for (const double view : round_ticks(0.0, views, 4)) {
    svg += fmt::format(
        "<text x=\"{0:.1f}\" y=\"{1:.1f}\" text-anchor=\"middle\">{2:.0f}</text>"
        "<text x=\"{3:.1f}\" y=\"{4:.1f}\" text-anchor=\"end\">{2:.0f}</text>",
        left + view * scale, side + 16.0, view, left - 4.0, view * scale + 9.0);
  }
  svg += fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">later view, number</text>",
      left + 0.5 * side, side + 32.0);
  return svg + fmt::format(
                   "<text transform=\"translate(11 {:.1f}) rotate(-90)\" "
                   "text-anchor=\"middle\">earlier view, number</text>",
                   0.5 * side);
}

// A matrix of all pairs, later views to the right, earlier ones downwards, with the corrections.
std::string matrix_svg(const ReportViewMatrix& matrix, bool errors,
                       const ReportCorrection::Pairs& marked) {
  constexpr double kLargestError = 0.5;  // P1 figure 5: beyond it stems count as outliers
  constexpr double kSide = 340.0;
  PalettePicture picture = grey_picture(matrix.side, matrix.side);
  for (int row = 0; row < matrix.side; ++row) {
    for (int column = row; column < matrix.side; ++column) {
      const auto at = static_cast<std::size_t>(row * matrix.side + column);
      const float overlap = matrix.overlap[at];
      const float error = matrix.error_m[at];
      const auto shade =
          static_cast<double>(errors ? error / static_cast<float>(kLargestError) : overlap);
      if (!std::isfinite(shade)) continue;
      picture.at(column, row) = grey(errors ? 0.9 * shade + 0.05 : shade);
      // Such a large step would tell something: much in common, far apart on the way.
      if (errors && overlap > 0.6F && column > row + 1) picture.at(column, row) = kRed;
    }
  }
  constexpr double kLeft = 52.0;
  std::string svg = fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" "
      "aria-label=\"all pairs of views\">"
      "<rect fill=\"#fff\" x=\"{:.0f}\" width=\"{:.0f}\" height=\"{:.0f}\"/>",
      kLeft + kSide + 14.0, kSide + 38.0, kLeft, kSide, kSide);
  svg += image(picture, kLeft, 0.0, kSide, kSide) + matrix_axes(matrix.views, kLeft, kSide);
  const double scale = kSide / std::max(1, matrix.views);
  for (const auto& [later, earlier] : marked) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}h8m-4 -4v8\" stroke=\"#1d8f3f\" stroke-width=\"1.6\"/>",
        kLeft + later * scale - 4.0, earlier * scale);
  }
  return svg + "</svg>";
}

// P1 figure 5.
std::string matrices(const ReportCorrection& correction) {
  if (correction.matrix_before.side < 2) return "";
  return "<h3>All pairs of views</h3><div class=\"trees matrices\">" +
         figure(matrix_svg(correction.matrix_before, false, {}),
                "Share of stems in common, white 0 to black 1.") +
         figure(matrix_svg(correction.matrix_before, true, correction.kept),
                "Mean distance of these before correction, white 0 to black 0.5 m; red: more than "
                "0.6 in common; green crosses: the corrections.") +
         figure(matrix_svg(correction.matrix_after, true, {}), "The same after correction.") +
         "</div>";
}

struct Window {
  double x0 = 0.0, y0 = 0.0, width_m = 1.0, height_m = 1.0;
};

Window whole_of(const std::vector<Eigen::Vector2f>& sights) {
  Eigen::Vector2f low = sights.front();
  Eigen::Vector2f high = low;
  for (const Eigen::Vector2f& at : sights) {
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  return {static_cast<double>(low.x()), static_cast<double>(low.y()),
          std::max(1.0, static_cast<double>(high.x() - low.x())),
          std::max(1.0, static_cast<double>(high.y() - low.y()))};
}

// How many sights fall on each cell: a dark dot where they fall on one place, a grey smear where
// they do not.
std::string sights_svg(const std::vector<Eigen::Vector2f>& sights, const Window& window) {
  constexpr double kWidth = 540.0;
  constexpr double kTallest = 700.0;
  const double cell = std::max(window.width_m / kWidth, window.height_m / kTallest);
  const int width = std::max(1, static_cast<int>(window.width_m / cell));
  const int height = std::max(1, static_cast<int>(window.height_m / cell));
  PalettePicture picture = grey_picture(width, height);
  std::vector<int> counts(picture.pixels.size(), 0);
  for (const Eigen::Vector2f& at : sights) {
    const double column = (static_cast<double>(at.x()) - window.x0) / cell;
    const double row = (window.y0 + window.height_m - static_cast<double>(at.y())) / cell;
    if (column < 0.0 || row < 0.0 || column >= width || row >= height) continue;
    ++counts[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
             static_cast<std::size_t>(column)];
  }
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] > 0) picture.pixels[k] = grey(0.25 + 0.25 * std::log2(counts[k]));
  }
  return fmt::format(
             "<svg class=\"paper\" viewBox=\"0 0 {} {}\" role=\"img\" "
             "aria-label=\"sights of stems from above\">",
             width, height) +
         image(picture, 0.0, 0.0, width, height) + "</svg>";
}

// P0 figure 11.
std::string sights(const ReportCorrection& correction) {
  if (correction.sights_after.empty() || correction.sights_before.empty()) return "";
  constexpr double kNear = 24.0;
  const Window near{static_cast<double>(correction.max_moved.x()) - 0.5 * kNear,
                    static_cast<double>(correction.max_moved.y()) - 0.5 * kNear, kNear, kNear};
  const Window whole = whole_of(correction.sights_after);
  const std::string across = fmt::format("{:.0f} m from left to right", whole.width_m);
  return "<h3>Every sight of every stem</h3><div class=\"panels\">" +
         figure(sights_svg(correction.sights_before, whole), "Before correction, " + across + ".") +
         figure(sights_svg(correction.sights_after, whole), "After correction, " + across + ".") +
         figure(sights_svg(correction.sights_before, near),
                fmt::format("{:.0f} m about the place that the correction moved most, before.",
                            kNear)) +
         figure(sights_svg(correction.sights_after, near), "The same, after.") + "</div>";
}

// P1 figure 8 (d).
std::string distances(const ReportCorrection& correction) {
  if (correction.trees_per_ha.empty()) return "";
  Histogram histogram;
  histogram.x_label = "distance from the path, m";
  histogram.y_label = "listed trees per ha";
  histogram.step = correction.ring_m;
  histogram.width = 1100;
  for (const double density : correction.trees_per_ha)
    histogram.counts.push_back(static_cast<int>(std::lround(density)));
  return "<h3>Trees over the distance from the path</h3>" + svg_histogram(histogram) +
         "<p class=\"so\">Where the stand is even, the list is whole as far as the bars stay "
         "level. A strip road holds fewer trees.</p>";
}

}  // namespace

std::string correction_figures(const ReportCorrection& correction) {
  std::string html;
  if (!correction.pairs.empty()) html += pair_scatter(correction);
  return html + matrices(correction) + sights(correction) + distances(correction);
}

}  // namespace understory
