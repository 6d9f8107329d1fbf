#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "understory/georeference/control_points.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/pipeline/georeferencing/methods/placement_figures.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

using namespace pipeline_constants::georeferencing;

using Eigen::Vector3d;

// A row of the table; the place in the survey is geodetic.
struct SurveyedRow {
  std::string name;
  GeodeticPlace place;
  bool has_height = false;
  Vector3d place_in_world = Vector3d::Zero();
};

// Where the run was at a time, or the place that the row names, in the axes of the run's files.
// `--antenna-m` is what stood on the point.
Vector3d place_in_run(const CsvReader& table, const GeoreferenceRequest& request,
                      const MovableRun& run, const std::string& name) {
  const Vector3d named(table.number("x"), table.number("y"), table.number("z"));
  if (named.allFinite()) return run.world_frame == WorldFrame::kNed ? turned_axes(named) : named;
  const double stamp_s = table.number("timestamp_s");
  if (!std::isfinite(stamp_s)) table.fail("expected x, y, z or timestamp_s of point " + name);
  TimeNs stamp = 0;
  if (!parse_seconds(std::string(table.text("timestamp_s")), stamp))
    table.fail("expected a time in seconds of point " + name);
  const Vector3d foot = request.antenna_in_body.value_or(Vector3d(Vector3d::Zero()));
  Vector3d sum = Vector3d::Zero();
  double count = 0.0;
  for (const double off_s : {-0.5, 0.0, 0.5}) {
    const auto at = antenna_place(run.trajectory, foot, stamp + from_seconds(off_s));
    if (!at) continue;
    sum += *at;
    count += 1.0;
  }
  if (count == 0.0) table.fail("expected a time of the run for point " + name);
  return sum / count;
}

std::vector<SurveyedRow> read_points(const GeoreferenceRequest& request, const MovableRun& run) {
  const CoordinateSystem system(request.layers.coordinate_system);
  CsvReader table(request.points, {"name", "east_m", "north_m"});
  std::vector<SurveyedRow> rows;
  while (table.next()) {
    SurveyedRow row;
    row.name = table.text("name");
    const double height = table.number("height_m");
    row.has_height = std::isfinite(height);
    const auto place = system.to_place(
        {table.finite("east_m"), table.finite("north_m"), row.has_height ? height : 0.0});
    if (!place) table.fail("expected east_m and north_m in " + request.layers.coordinate_system);
    row.place = *place;
    row.place_in_world = place_in_run(table, request, run, row.name);
    rows.push_back(row);
  }
  if (rows.empty()) throw InputError(request.points.string(), "", "expected control points");
  return rows;
}

void add_point_figures(const std::vector<ControlPoint>& points, const ControlFit& fit,
                       const std::string& file, Placement& placement) {
  std::string blunders;
  double squares = 0.0;
  std::int64_t used = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    PlacementResidual one;
    one.name = points[k].name;
    one.residual_in_target = fit.residuals[k];
    one.used = fit.used[k] != 0;
    const double off = std::isfinite(fit.residuals[k].z()) ? fit.residuals[k].norm()
                                                           : fit.residuals[k].head<2>().norm();
    if (one.used) {
      squares += off * off;
      ++used;
    } else {
      one.reason = "does not agree with the other points";
      blunders += fmt::format("{}{} ({:.2f} m off)", blunders.empty() ? "" : ", ", one.name, off);
    }
    placement.residuals.push_back(one);
  }
  placement.figures["points"] = static_cast<std::int64_t>(points.size());
  placement.figures["points_used"] = used;
  placement.figures["points_rms_m"] = std::sqrt(squares / static_cast<double>(used));
  placement.figures["points_error_m"] = fit.sd_m;
  if (!blunders.empty())
    placement.doubt(
        fmt::format("{}: control point {} does not agree with the other {} and was "
                    "left out",
                    file, blunders, used));
  if (fit.disagree)
    placement.doubt(
        fmt::format("{}: the control points do not agree ({:.2f} m), and fewer than "
                    "four cannot tell which of them is wrong",
                    file, std::sqrt(squares / static_cast<double>(used))));
}

}  // namespace

Placement place_by_points(const GeoreferenceRequest& request, const MovableRun& run, Log& /*log*/) {
  const std::vector<SurveyedRow> rows = read_points(request, run);
  Placement placement;
  placement.origin = rows.front().place;
  for (const SurveyedRow& row : rows) {
    if (row.has_height) {
      placement.origin->height_m = row.place.height_m;
      break;
    }
  }
  const EastNorthUp frame(*placement.origin);
  std::vector<ControlPoint> points;
  for (const SurveyedRow& row : rows) {
    GeodeticPlace place = row.place;
    if (!row.has_height) place.height_m = placement.origin->height_m;
    ControlPoint point{row.name, row.place_in_world, frame.from_place(place)};
    if (!row.has_height) point.place_in_target.z() = std::numeric_limits<double>::quiet_NaN();
    points.push_back(point);
  }
  ControlFitConfig config;
  config.tilt_sd_deg = tilt_sd_deg(request, run);
  const ControlFit fit = fit_control_points(points, config);
  if (!fit.found) throw InputError(request.points.string(), "", fit.reason);
  placement.target_from_world = fit.target_from_world;
  placement.covariance = fit.covariance;
  add_point_figures(points, fit, request.points.string(), placement);
  tell_placement(run.trajectory, placement);
  const double heading_sd_deg = std::get<double>(placement.figures.at("sd_heading_deg"));
  if (heading_sd_deg > kMostHeadingSdDeg)
    placement.doubt(
        fmt::format("the control points are too near to each other: the heading is "
                    "uncertain by {:.1f} degrees",
                    heading_sd_deg));
  placement.summary = fmt::format(
      "points: {} of {} control points used, {:.2f} m off (root mean square)\nexpected error "
      "{:.2f} "
      "m over the path; one standard deviation: {}",
      std::get<std::int64_t>(placement.figures.at("points_used")), points.size(),
      std::get<double>(placement.figures.at("points_rms_m")), placement.expected_error_m,
      precision_of(placement));
  placement.inputs.push_back(hash_input(request.points));
  return placement;
}

}  // namespace understory
