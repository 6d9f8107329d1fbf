#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "understory/output/output_constants.h"
#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/fixed_text.h"

namespace understory {

using namespace output_constants::matching;

namespace {

constexpr std::size_t kPlotPoints = 1'600;
constexpr std::size_t kLongestLoopList = 40;

using Series = std::vector<std::pair<double, double>>;

// Long runs are read in minutes, short ones in seconds.
struct TimeAxis {
  TimeNs start = 0;
  double unit_s = 1.0;
  std::string label = "time since the start, s";

  [[nodiscard]] double of(TimeNs stamp) const { return to_seconds(stamp - start) / unit_s; }
};

TimeAxis time_axis(const ReportInput& input) {
  TimeAxis axis;
  if (input.scans.empty()) return axis;
  axis.start = input.scans.front().stamp;
  if (to_seconds(input.scans.back().stamp - axis.start) > 600.0) {
    axis.unit_s = 60.0;
    axis.label = "time since the start, min";
  }
  return axis;
}

template <typename Value>
Series series_of(const ReportInput& input, const Value& value) {
  const TimeAxis axis = time_axis(input);
  Series series;
  series.reserve(input.scans.size());
  for (const ReportScan& scan : input.scans)
    series.emplace_back(axis.of(scan.stamp), value(scan));
  return series;
}

Series thinned_with_gaps(const Series& series) {
  // A NaN compares with nothing, so parts between gaps are thinned one by one.
  Series result;
  Series part;
  const auto flush = [&] {
    const std::size_t share = std::max<std::size_t>(
        4, kPlotPoints * part.size() / std::max<std::size_t>(1, series.size()));
    const Series kept = thinned_series(part, share);
    result.insert(result.end(), kept.begin(), kept.end());
    part.clear();
  };
  for (const auto& point : series) {
    if (std::isfinite(point.second)) {
      part.push_back(point);
      continue;
    }
    flush();
    if (result.empty() || std::isfinite(result.back().second)) result.push_back(point);
  }
  flush();
  return result;
}

// What was looked at, what the table below holds, and what came of it.
std::string loop_counts(const ReportInput& input) {
  const auto accepted = static_cast<std::size_t>(std::count_if(
      input.loops.begin(), input.loops.end(), [](const ReportLoop& l) { return l.accepted; }));
  const std::size_t rejected = input.loops.size() - accepted;
  if (input.loops.empty() && input.loops_not_listed == 0) return {};
  if (input.loops_not_listed == 0)
    return fmt::format(
        "<p>{} {} tried (the table below): {} closed, {} rejected as not certain.</p>",
        input.loops.size(), input.loops.size() == 1 ? "loop was" : "loops were", accepted,
        rejected);
  return fmt::format(
      "<p>{} views look like an earlier place. Matching their stems confirmed {} of them (the "
      "table below): {} closed, {} rejected because they contradict the others. The other {} were "
      "no loops. In loops.csv their column verified is 0.</p>",
      input.loops.size() + input.loops_not_listed, input.loops.size(), accepted, rejected,
      input.loops_not_listed);
}

// How many scans matched well, weakly and not at all.
std::string match_shares(const ReportInput& input) {
  std::size_t weak = 0;
  std::size_t lost = 0;
  for (std::size_t i = 1; i < input.scans.size(); ++i) {
    if (std::isnan(input.scans[i].inlier_ratio)) {
      ++lost;
    } else if (input.scans[i].weak) {
      ++weak;
    }
  }
  // The first scan is where the map begins: it has nothing to match.
  const double all = static_cast<double>(std::max<std::size_t>(2, input.scans.size()) - 1);
  return fmt::format(
      "<p>The program lays each scan on the map of the scans before it. {:.1f} % of the scans "
      "matched well, {:.1f} % weakly (orange on the map), {:.1f} % not at all (red: the position "
      "is a prediction).</p>",
      100.0 * (all - static_cast<double>(weak + lost)) / all,
      100.0 * static_cast<double>(weak) / all, 100.0 * static_cast<double>(lost) / all);
}

// What the distance of matched points is measured from, and which values are usual.
std::string distance_meaning(const ReportInput& input) {
  const std::string line = " A level line is good. A line that rises means that the map blurs.</p>";
  if (!(input.map_cell_m > 0.0))
    return "<p>Distance of the scan's points from the nearest surface of the map." + line;
  const double cell_cm = 100.0 * input.map_cell_m;
  return fmt::format(
             "<p>The map keeps one mean place for each cube of {:.0f} cm. The distance is that of "
             "a point to the mean of its cube, so it is not the error of the map. Usual are {:.0f} "
             "to {:.0f} cm, and {:.0f} cm come about by chance.",
             cell_cm, kLeastUsual * cell_cm, kMostUsual * cell_cm, kByChance * cell_cm) +
         line;
}

}  // namespace

std::string matching_section(const ReportInput& input) {
  if (input.scans.empty() || input.moved) return "";
  std::string html = "<section><h2>How well the scans matched</h2>" + match_shares(input);
  const TimeAxis axis = time_axis(input);
  Plot plot;
  plot.x_label = axis.label;
  plot.y_label = input.correction ? "stems matched, %" : "points matched, %";
  plot.y_max = 100.0;
  plot.height = 200;
  plot.width = 1100;
  plot.series.push_back({"", "var(--line)", thinned_with_gaps(series_of(input, [](const auto& s) {
                           return 100.0 * static_cast<double>(s.inlier_ratio);
                         }))});
  html +=
      input.correction
          ? "<h3>Stems found again</h3><p>Share of a view's stems that have a partner in the map."
          : "<h3>Points found again</h3><p>Share of a scan's points that have a partner in the "
            "map.";
  html +=
      " A dip shows where the scanner saw little that it had seen before: look at the map "
      "there.</p>" +
      svg_plot(plot);
  const bool measured = std::any_of(input.scans.begin(), input.scans.end(), [](const auto& scan) {
    return std::isfinite(scan.fitness_m2);
  });
  if (!measured) return html + "</section>\n";
  Plot fitness = plot;
  fitness.y_max = 0.0;
  fitness.y_label = "distance from the map, cm";
  fitness.series[0].points = thinned_with_gaps(series_of(
      input, [](const auto& s) { return 100.0 * std::sqrt(static_cast<double>(s.fitness_m2)); }));
  return html + "<h3>Distance of the matched points from the map</h3>" + distance_meaning(input) +
         svg_plot(fitness) + "</section>\n";
}

std::string loops_section(const ReportInput& input) {
  if (input.scans.empty() || input.moved) return "";
  std::string html =
      "<section><h2>Places seen again</h2><p>Where the path returns to a place, the program "
      "recognises it. It then takes out the error that has grown since: it closes a loop.</p>";
  if (!input.loop_closure_enabled) return html + "<p>This was switched off.</p></section>\n";
  html += loop_counts(input);
  if (input.loops.empty()) {
    return html +
           "<p>The path did not come back to a place that it had seen long before, or not "
           "near enough to try. " +
           (input.correction && !input.correction->kept.empty()
                ? "Errors that grew along the way are corrected by views matched again (below)."
                : "Errors that grew along the way are not corrected.") +
           "</p></section>\n";
  }
  const TimeAxis axis = time_axis(input);
  html += fmt::format(
      "<div class=\"scroll\"><table><thead><tr><th></th><th class=\"n\">at ({0})</th><th "
      "class=\"n\">seen at ({0})</th><th class=\"n\">corrected by, m</th><th>remark</th></tr>"
      "</thead><tbody>",
      axis.unit_s > 1.0 ? "min" : "s");
  std::size_t shown = 0;
  for (const bool wanted : {true, false}) {
    for (const ReportLoop& loop : input.loops) {
      if (loop.accepted != wanted || shown >= kLongestLoopList) continue;
      ++shown;
      html += fmt::format(
          "<tr><td>{}</td><td class=\"n\">{:.1f}</td><td class=\"n\">{:.1f}</td><td "
          "class=\"n\">{}</td><td>{}</td></tr>",
          loop.accepted ? "closed" : "rejected", axis.of(loop.to_stamp), axis.of(loop.from_stamp),
          loop.accepted ? fmt::format("{:.3f}", loop.correction_m) : "", escape_html(loop.reason));
    }
  }
  html += "</tbody></table></div>";
  if (shown < input.loops.size()) {
    html += fmt::format("<p class=\"sub\">The first {} of {} are shown.</p>", shown,
                        input.loops.size());
  }
  return html + "</section>\n";
}

std::string truth_section(const ReportInput& input) {
  if (!input.truth) return "";
  const ReportTruth& truth = *input.truth;
  std::string html =
      "<section><h2>Errors against the known truth</h2><p>The true path is known here, as in a "
      "simulation.</p><div class=\"wide\"><table>";
  const auto row = [&](const std::string& name, const std::string& value) {
    html += "<tr><td>" + escape_html(name) + "</td><td class=\"n\">" + escape_html(value) +
            "</td></tr>";
  };
  const auto metres = [&](const char* name, double value) {
    if (std::isfinite(value)) row(name, fmt::format("{:.3f} m", value));
  };
  row("how the path was laid on the true one", truth.alignment);
  metres("position error (APE), root mean square", truth.ape_rmse_m);
  metres("position error, largest", truth.ape_max_m);
  metres("error at the end, with the starts laid on each other (drift)", truth.drift_end_m);
  if (std::isfinite(truth.drift_percent)) {
    row("the same as a share of the path", fmt::format("{:.3f} %", truth.drift_percent));
  }
  for (const auto& [name, value] : truth.more)
    row(name, value);
  html += "</table></div>";
  if (!truth.ape_over_time.empty()) {
    const TimeAxis axis = time_axis(input);
    Plot plot;
    plot.x_label = axis.label;
    plot.y_label = "position error, cm";
    plot.width = 1100;
    plot.height = 200;
    Series series;
    for (const auto& [time_s, error_m] : truth.ape_over_time)
      series.emplace_back(time_s / axis.unit_s, 100.0 * error_m);
    plot.series.push_back({"", "var(--bad)", thinned_series(series, kPlotPoints)});
    html += "<h3>Position error along the run</h3>" + svg_plot(plot);
  }
  return html + "</section>\n";
}

std::string imu_section(const ReportInput& input) {
  if (!input.summary.imu_calibration) return "";
  const ImuCalibrationFigures& imu = *input.summary.imu_calibration;
  std::string html = fmt::format(
      "<section><h2>Place and clock of the IMU</h2><p>The recording itself tells them, by {:.0f} s "
      "of motion. {}</p><div class=\"wide\"><table><tr><th></th><th class=\"n\">refined</th><th "
      "class=\"n\">standard deviation</th></tr>",
      imu.duration_s,
      imu.begun_anew == 0
          ? std::string("It was mapped with those given.")
          : fmt::format(
                "It was mapped with an IMU that lies {:.3f} m and {:.2f} degrees from where "
                "it was given, and whose stamps are {} ms late.",
                imu.moved_m, imu.turned_deg, fixed_text(1e3 * imu.used_late_s, 1)));
  const auto row = [&](const char* name, double value, std::size_t parameter, double unit) {
    const double sd = unit * std::sqrt(std::max(imu.covariance[8 * parameter], 0.0));
    html += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>", name,
                        fixed_text(value, 3), sd > 0.0 ? fmt::format("{:.3f}", sd) : "as given");
  };
  row("stamps late by, ms", 1e3 * imu.late_s, 6, 1e3);
  row("x on the body, m", imu.translation_m[0], 3, 1.0);
  row("y on the body, m", imu.translation_m[1], 4, 1.0);
  row("z on the body, m", imu.translation_m[2], 5, 1.0);
  return html +
         "</table></div><p>Its rotation and the whole covariance stand in run.json, under "
         "imu_calibration.</p></section>\n";
}

std::string time_section(const ReportInput& input) {
  std::string html;
  const bool timed = std::any_of(input.scans.begin(), input.scans.end(),
                                 [](const ReportScan& scan) { return scan.wall_ms > 0.0F; });
  if (timed) {
    const TimeAxis axis = time_axis(input);
    Plot plot;
    plot.x_label = axis.label;
    plot.y_label = "time per scan, ms";
    plot.width = 1100;
    plot.series.push_back({"", "var(--line)", thinned_with_gaps(series_of(input, [](const auto& s) {
                             return static_cast<double>(s.wall_ms);
                           }))});
    if (input.sensor_period_ms > 0.0) {
      plot.levels.push_back({"a new scan comes", input.sensor_period_ms});
    }
    html += "<h3>Each scan</h3>" + svg_plot(plot);
  }
  if (!input.summary.stages.empty()) {
    html +=
        "<h3>Stages</h3><div class=\"wide\"><table><tr><th>stage</th><th class=\"n\">runs</th><th "
        "class=\"n\">mean, ms</th><th class=\"n\">median, ms</th><th class=\"n\">99 % under, "
        "ms</th><th class=\"n\">longest, ms</th><th class=\"n\">CPU mean, ms</th><th "
        "class=\"n\">all, s</th></tr>";
    for (const auto& [name, stage] : input.summary.stages) {
      const Distribution& wall = stage.wall_ms;
      html += fmt::format(
          "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.2f}</td><td class=\"n\">{:.2f}"
          "</td><td class=\"n\">{:.2f}</td><td class=\"n\">{:.2f}</td><td "
          "class=\"n\">{:.2f}</td><td "
          "class=\"n\">{:.1f}</td></tr>",
          escape_html(name), wall.count, wall.mean, wall.p50, wall.p99, wall.max, stage.cpu_ms.mean,
          stage.total_wall_s);
    }
    html += "</table></div>";
  }
  return html.empty() ? ""
                      : "<section><h2>Time</h2><p>Time of computing, for those who run the program "
                        "on a machine in the forest.</p>" +
                            html + "</section>\n";
}

}  // namespace understory
