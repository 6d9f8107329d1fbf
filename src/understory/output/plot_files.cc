#include "understory/output/plot_files.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "understory/util/files/atomic_file.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr const char* kAllSeen = "seen";

// Middle of the box of a plot that has no centre.
Eigen::Vector2d middle_of(const PlotShape& shape) {
  if (shape.centre.allFinite() || shape.rings.empty()) return shape.centre;
  const Eigen::Vector4d box = shape.box();
  return 0.5 * (box.head<2>() + box.tail<2>());
}

std::string row_of(const StandPlot& plot) {
  std::string row = csv_text(plot.shape.id) + "," + plot.shape.kind;
  for (const PlotColumn& column : plot_columns())
    row += "," + csv_cell(column.value(plot), column.decimals);
  return row + "\n";
}

std::string classes_of_plot(const StandPlot& plot) {
  std::string rows;
  for (const DiameterClass& one : plot.figures.classes)
    rows += fmt::format(
        "{},{:.3f},{:.3f},{},{},{},{},{}\n", csv_text(plot.shape.id), one.from_m, one.to_m,
        one.trees, csv_cell(one.stems_per_ha.value, 2), csv_cell(one.stems_per_ha.sd, 2),
        csv_cell(one.basal_area_m2_per_ha.value, 4), csv_cell(one.basal_area_m2_per_ha.sd, 4));
  return rows;
}

template <Measured StandFigures::*kFigure>
double value_of(const StandPlot& plot) {
  return (plot.figures.*kFigure).value;
}

// The deviation of a figure that is not known is not known either.
template <Measured StandFigures::*kFigure>
double sd_of(const StandPlot& plot) {
  const Measured& figure = plot.figures.*kFigure;
  return std::isfinite(figure.value) ? figure.sd : figure.value;
}

StandPlot all_seen(const StandTable& stand) {
  StandPlot plot;
  plot.shape.id = kAllSeen;
  plot.shape.kind = kAllSeen;
  plot.figures = stand.seen;
  return plot;
}

}  // namespace

const std::vector<PlotColumn>& plot_columns() {
  static const std::vector<PlotColumn> columns = {
      {"x", [](const StandPlot& p) { return middle_of(p.shape).x(); }, 3},
      {"y", [](const StandPlot& p) { return middle_of(p.shape).y(); }, 3},
      {"radius_m", [](const StandPlot& p) { return p.shape.radius_m; }, 3},
      {"area_m2", [](const StandPlot& p) { return p.figures.area_m2; }, 2},
      {"seen_m2", [](const StandPlot& p) { return p.figures.seen_m2; }, 2},
      {"seen_share", [](const StandPlot& p) { return p.figures.seen_share; }, 4},
      {"trees", [](const StandPlot& p) { return static_cast<double>(p.figures.trees); }, 0},
      {"stems_per_ha", value_of<&StandFigures::stems_per_ha>, 2},
      {"stems_per_ha_sd", sd_of<&StandFigures::stems_per_ha>, 2},
      {"basal_area_m2_per_ha", value_of<&StandFigures::basal_area_m2_per_ha>, 4},
      {"basal_area_sd_m2_per_ha", sd_of<&StandFigures::basal_area_m2_per_ha>, 4},
      {"mean_dbh_m", value_of<&StandFigures::mean_dbh_m>, 5},
      {"mean_dbh_sd_m", sd_of<&StandFigures::mean_dbh_m>, 5},
      {"weighted_dbh_m", value_of<&StandFigures::weighted_dbh_m>, 5},
      {"weighted_dbh_sd_m", sd_of<&StandFigures::weighted_dbh_m>, 5},
      {"weighted_height_m", value_of<&StandFigures::weighted_height_m>, 3},
      {"weighted_height_sd_m", sd_of<&StandFigures::weighted_height_m>, 3},
      {"dominant_height_m", value_of<&StandFigures::dominant_height_m>, 3},
      {"dominant_height_sd_m", sd_of<&StandFigures::dominant_height_m>, 3},
      {"dominant_trees", [](const StandPlot& p) { return p.figures.dominant_trees; }, 2},
      {"volume_m3_per_ha", value_of<&StandFigures::volume_m3_per_ha>, 3},
      {"volume_sd_m3_per_ha", sd_of<&StandFigures::volume_m3_per_ha>, 3},
      {"national_volume_m3_per_ha", value_of<&StandFigures::national_m3_per_ha>, 3},
      {"national_volume_sd_m3_per_ha", sd_of<&StandFigures::national_m3_per_ha>, 3},
      {"heights_filled_in",
       [](const StandPlot& p) { return static_cast<double>(p.figures.heights_filled_in); }, 0},
      {"volumes_filled_in",
       [](const StandPlot& p) { return static_cast<double>(p.figures.volumes_filled_in); }, 0},
      {"heights_lower_bounds",
       [](const StandPlot& p) { return static_cast<double>(p.figures.heights_lower_bounds); }, 0},
  };
  return columns;
}

void write_plot_tables(const std::filesystem::path& folder, const StandTable& stand) {
  AtomicTextFile table(folder / "plots.csv");
  std::string header = "plot,kind";
  for (const PlotColumn& column : plot_columns())
    header += std::string(",") + column.name;
  table.write(header + "\n");
  table.write(row_of(all_seen(stand)));
  for (const StandPlot& plot : stand.plots)
    table.write(row_of(plot));
  table.commit();
  AtomicTextFile classes(folder / "plot_classes.csv");
  classes.write(
      "plot,dbh_from_m,dbh_to_m,trees,stems_per_ha,stems_per_ha_sd,basal_area_m2_per_ha,"
      "basal_area_sd_m2_per_ha\n");
  classes.write(classes_of_plot(all_seen(stand)));
  for (const StandPlot& plot : stand.plots)
    classes.write(classes_of_plot(plot));
  classes.commit();
}

}  // namespace understory
