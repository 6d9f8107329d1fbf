#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"

namespace understory {
namespace {

constexpr std::size_t kMostPlotRows = 500;

// A figure with its standard deviation, `scale` times the value; empty where it is not known.
std::string with_error(const Measured& figure, int decimals, double scale = 1.0) {
  if (!std::isfinite(figure.value)) return "";
  return fmt::format("{:.{}f} ± {:.{}f}", scale * figure.value, decimals, scale * figure.sd,
                     decimals);
}

// A column of the table of figures.
struct FigureColumn {
  const char* title;
  std::string (*cell)(const StandFigures& figures);
};

std::vector<FigureColumn> figure_columns(bool national) {
  std::vector<FigureColumn> columns = {
      {"seen, m²", [](const StandFigures& f) { return fmt::format("{:.0f}", f.seen_m2); }},
      {"seen, %",
       [](const StandFigures& f) { return fmt::format("{:.0f}", 100.0 * f.seen_share); }},
      {"trees", [](const StandFigures& f) { return count_text(f.trees); }},
      {"stems per ha", [](const StandFigures& f) { return with_error(f.stems_per_ha, 0); }},
      {"basal area, m²/ha",
       [](const StandFigures& f) { return with_error(f.basal_area_m2_per_ha, 2); }},
      {"mean diameter, cm",
       [](const StandFigures& f) { return with_error(f.mean_dbh_m, 1, 100.0); }},
      {"weighted diameter, cm",
       [](const StandFigures& f) { return with_error(f.weighted_dbh_m, 1, 100.0); }},
      {"weighted height, m",
       [](const StandFigures& f) { return with_error(f.weighted_height_m, 1); }},
      {"dominant height, m",
       [](const StandFigures& f) { return with_error(f.dominant_height_m, 1); }},
      {"volume, m³/ha", [](const StandFigures& f) { return with_error(f.volume_m3_per_ha, 1); }}};
  if (national)
    columns.push_back({"national volume, m³/ha",
                       [](const StandFigures& f) { return with_error(f.national_m3_per_ha, 1); }});
  return columns;
}

std::string figure_row(const std::string& name, const StandFigures& figures,
                       const std::vector<FigureColumn>& columns) {
  std::string row = "<tr><td>" + escape_html(name) + "</td>";
  for (const FigureColumn& column : columns)
    row += "<td class=\"n\">" + column.cell(figures) + "</td>";
  return row + "</tr>";
}

std::string figure_table(const StandTable& stand) {
  const std::vector<FigureColumn> columns =
      figure_columns(stand.config.species != TaperSpecies::kUnknown);
  std::string html = "<div class=\"scroll\"><table class=\"sort figures\"><thead><tr><th>plot</th>";
  for (const FigureColumn& column : columns)
    html += fmt::format("<th class=\"n\">{}</th>", column.title);
  html += "</tr></thead><tbody>" + figure_row("all that was seen", stand.seen, columns);
  for (std::size_t i = 0; i < std::min(stand.plots.size(), kMostPlotRows); ++i)
    html += figure_row(stand.plots[i].shape.id, stand.plots[i].figures, columns);
  html += "</tbody></table></div>";
  if (stand.plots.size() > kMostPlotRows)
    html += fmt::format("<p class=\"sub\">The first {} of {}; all are in plots.csv.</p>",
                        kMostPlotRows, stand.plots.size());
  return html;
}

// What was not measured, and what stands for it.
std::string filled_in(const StandTable& stand) {
  const StandFigures& seen = stand.seen;
  std::string html;
  if (seen.heights_filled_in > 0 && stand.curve)
    html += fmt::format(
        " The tops of {} of these {} trees were not seen, or not surely. A height curve of {} "
        "trees "
        "of the list stands for their heights (single trees are ± {:.1f} m about it).",
        seen.heights_filled_in, seen.trees, stand.curve->trees, stand.curve->sd_m);
  if (seen.heights_filled_in > 0 && !stand.curve)  // of a run that was moved
    html += fmt::format(
        " The tops of {} of these {} trees were not seen, or not surely. A height curve stands for "
        "their heights.",
        seen.heights_filled_in, seen.trees);
  if (seen.heights_lower_bounds > 0)
    html += fmt::format(
        " Heights and volumes are <b>lower bounds</b>: the tops of {} of {} trees were not seen, "
        "and too few others show theirs for a height curve.",
        seen.heights_lower_bounds, seen.trees);
  if (seen.volumes_filled_in > 0 && std::isfinite(stand.form_factor))
    html += fmt::format(
        " {} volumes are basal area times height times {:.2f}, the form factor of the others.",
        seen.volumes_filled_in, stand.form_factor);
  if (stand.without_diameter > 0)
    html += fmt::format(" {} trees without a diameter do not count.", stand.without_diameter);
  return html.empty() ? "" : "<p>" + html.substr(1) + "</p>";
}

std::string class_chart(const StandTable& stand) {
  Histogram histogram;
  histogram.x_label = "diameter at 1.3 m, cm";
  histogram.y_label = "stems per ha";
  histogram.step = 100.0 * stand.config.class_m;
  for (const DiameterClass& one : stand.seen.classes) {
    const auto bin = static_cast<std::size_t>(std::lround(one.from_m / stand.config.class_m));
    if (histogram.counts.size() <= bin) histogram.counts.resize(bin + 1, 0);
    histogram.counts[bin] = static_cast<int>(std::lround(one.stems_per_ha.value));
  }
  if (histogram.counts.empty()) return "";
  histogram.counts.push_back(0);
  return "<h3>Diameter distribution</h3><div class=\"two\"><figure>" + svg_histogram(histogram) +
         "</figure></div>";
}

}  // namespace

std::string plots_section(const ReportInput& input) {
  if (input.stand == nullptr || input.stand->seen.trees == 0) return "";
  const StandTable& stand = *input.stand;
  return "<section><h2>Stand figures</h2><p>" +
         fmt::format(
             "Trees of {:.0f} cm and more, by hectare of the area in which stems could be "
             "seen. What was not seen of a plot is taken to be like the rest of it. ± is "
             "one standard deviation of the errors of measurement. It does not say how "
             "far a plot is from the whole stand.</p>",
             100.0 * stand.config.min_dbh_m) +
         filled_in(stand) + figure_table(stand) + class_chart(stand) + "</section>\n";
}

}  // namespace understory
