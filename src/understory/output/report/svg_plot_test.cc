#include "understory/output/report/svg_plot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/output/report/test_count.h"

namespace understory {
namespace {

using test::count_of;

TEST(SvgPlot, AxesHaveTheirLabelsAndTicks) {
  Plot plot;
  plot.x_label = "time, s";
  plot.y_label = "error <cm>";
  plot.series.push_back({"run & truth", "var(--line)", {{0.0, 0.0}, {5.0, 4.0}, {10.0, 1.0}}});
  plot.levels.push_back({"limit", 3.0});
  const std::string svg = svg_plot(plot);
  EXPECT_EQ(count_of(svg, "<svg"), 1U);
  EXPECT_EQ(count_of(svg, "</svg>"), 1U);
  for (const char* text : {"time, s", "error &lt;cm&gt;", ">limit<", ">10<", ">4<"})
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  EXPECT_EQ(svg.find("nan"), std::string::npos);
}

TEST(SvgPlot, ALineBreaksWhereAValueIsMissing) {
  Plot plot;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  plot.series.push_back({"", "red", {{0.0, 1.0}, {1.0, 2.0}, {2.0, 1.0}, {3.0, 2.0}}});
  const std::string whole = svg_plot(plot);
  plot.series[0].points = {{0.0, 1.0}, {1.0, 2.0}, {1.5, nan}, {2.0, 1.0}, {3.0, 2.0}};
  const std::string broken = svg_plot(plot);
  EXPECT_EQ(broken.find("nan"), std::string::npos);
  // A part of a line begins with M.
  EXPECT_EQ(count_of(broken, "M"), count_of(whole, "M") + 1);
}

TEST(SvgPlot, NoPointsAreAnEmptyPlot) {
  Plot plot;
  plot.x_label = "time, s";
  plot.series.push_back({"", "red", {}});
  const std::string svg = svg_plot(plot);
  EXPECT_NE(svg.find("time, s"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
}

TEST(SvgPlot, AHistogramHasABarPerClassThatHoldsSomething) {
  Histogram histogram;
  histogram.x_label = "diameter, cm";
  histogram.first = 10.0;
  histogram.step = 5.0;
  histogram.counts = {1, 0, 4, 2};
  const std::string svg = svg_histogram(histogram);
  EXPECT_NE(svg.find("diameter, cm"), std::string::npos);
  EXPECT_EQ(count_of(svg, "class=\"bar\""), 3U);
}

TEST(SvgPlot, ThinningKeepsPeaks) {
  std::vector<std::pair<double, double>> series;
  for (int i = 0; i < 10'000; ++i)
    series.emplace_back(i, std::sin(0.01 * i));
  series[4321].second = 7.0;
  series[8765].second = -9.0;
  const auto thinned = thinned_series(series, 100);
  EXPECT_LE(thinned.size(), 100U);
  EXPECT_GE(thinned.size(), 40U);
  EXPECT_NE(std::find(thinned.begin(), thinned.end(), std::make_pair(4321.0, 7.0)), thinned.end());
  EXPECT_NE(std::find(thinned.begin(), thinned.end(), std::make_pair(8765.0, -9.0)), thinned.end());
  EXPECT_TRUE(std::is_sorted(thinned.begin(), thinned.end()));
  EXPECT_EQ(thinned_series({{0.0, 1.0}, {1.0, 2.0}}, 100).size(), 2U);
}

TEST(SvgPlot, TicksAreRoundAndWithinTheirRange) {
  EXPECT_EQ(round_ticks(0.0, 10.0, 5), (std::vector<double>{0.0, 2.0, 4.0, 6.0, 8.0, 10.0}));
  for (const auto& [low, high] : {std::pair{0.13, 0.97}, {-45.0, 1230.0}, {1e-6, 3e-6}}) {
    const std::vector<double> ticks = round_ticks(low, high, 6);
    ASSERT_GE(ticks.size(), 3U) << low;
    EXPECT_LE(ticks.size(), 13U) << low;
    EXPECT_GE(ticks.front(), low - 1e-9 * high);
    EXPECT_LE(ticks.back(), high + 1e-9 * high);
  }
  EXPECT_EQ(tick_text(2.0, 1.0), "2");
  EXPECT_EQ(tick_text(0.25, 0.05), "0.25");
}

TEST(SvgPlot, TextCannotEndATag) {
  EXPECT_EQ(escape_html("a < b && \"c\" > 'd'").find_first_of("<>\""), std::string::npos);
  EXPECT_EQ(escape_html("plot 7"), "plot 7");
}

TEST(SvgPlot, LogarithmicAxesHavePowersOfTen) {
  Plot plot;
  plot.x_label = "averaging time (s)";
  plot.y_label = "deviation (rad/s)";
  plot.logarithmic = true;
  plot.series = {{"x", "red", {{0.1, 1e-3}, {1.0, 1e-4}, {100.0, 1e-5}}, false}};
  const std::string svg = svg_plot(plot);
  for (const char* tick : {">0.1<", ">1<", ">10<", ">100<", ">0.001<", ">1e-4<", ">1e-5<"})
    EXPECT_NE(svg.find(tick), std::string::npos) << tick;
  // The three points are equally far apart in y, and in x by 1 and 2 decades of three.
  EXPECT_NE(svg.find("M58.0 12.0L274.0 105.0L706.0 198.0"), std::string::npos) << svg;
}

TEST(SvgPlot, WhatHasNoLogarithmIsNotDrawn) {
  Plot plot;
  plot.logarithmic = true;
  plot.series = {{"x", "red", {{0.1, 1e-3}, {1.0, 0.0}, {10.0, -1.0}, {100.0, 1e-5}}, true}};
  const std::string svg = svg_plot(plot);
  EXPECT_EQ(svg.find("inf"), std::string::npos) << svg;
  EXPECT_EQ(svg.find("nan"), std::string::npos) << svg;
}

}  // namespace
}  // namespace understory
