#include "understory/pipeline/georeferencing/map_placing.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "understory/georeference/satellites/split_fit.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/sensor/fix_position.h"
#include "understory/util/error.h"

namespace understory {
namespace {

const PlacementMethod& method_of(GeoreferenceMethod wanted) {
  const std::vector<PlacementMethod>& methods = placement_methods();
  const auto found = std::find_if(methods.begin(), methods.end(),
                                  [&](const PlacementMethod& one) { return one.method == wanted; });
  UNDERSTORY_CHECK(found != methods.end());
  return *found;
}

// One row for each fix, as far as nothing is known of its place in the world frame.
std::vector<GnssRow> rows_of(const std::vector<GnssFix>& fixes, const std::string& reason) {
  std::vector<GnssRow> rows;
  for (const GnssFix& fix : fixes) {
    GnssRow row;
    row.fix = fix;
    row.reason = has_position(fix) ? reason : "no fix";
    rows.push_back(row);
  }
  return rows;
}

void write_rows(const std::filesystem::path& folder, const std::vector<GnssRow>& rows) {
  GnssWriter writer(folder / "gnss.csv");
  for (const GnssRow& row : rows)
    writer.add(row);
  writer.commit();
}

// By a motion whose inverse is nearly in the plane; a height that is not known stays so.
Eigen::Vector3d moved(const Pose& motion, const Eigen::Vector3d& point) {
  if (std::isfinite(point.z())) return motion * point;
  Eigen::Vector3d result = motion * Eigen::Vector3d(point.x(), point.y(), 0.0);
  result.z() = point.z();
  return result;
}

// What the fit says of each fix, brought back into the world frame of the run.
void fill_rows(const Placement& placement, const RunPlace& place, std::vector<GnssRow>& rows) {
  constexpr TimeNs kSame = 1'000;  // a table of fixes keeps no more digits
  const Pose world_from_enu = placement.target_from_world.inverse();
  const Pose turn(world_from_enu.rotation(), Eigen::Vector3d::Zero());
  std::size_t next = 0;
  for (const GnssRow& fitted : placement.gnss) {
    while (next < rows.size() && rows[next].fix.stamp < fitted.fix.stamp - kSame)
      ++next;
    if (next == rows.size()) break;
    GnssRow& row = rows[next];
    if (row.fix.stamp > fitted.fix.stamp + kSame) continue;
    ++next;
    row.position_in_world = moved(world_from_enu, fitted.position_in_world);
    row.residual = moved(turn, fitted.residual);
    row.used = place.on_globe && fitted.used;
    row.reason = place.on_globe ? fitted.reason : place.reason;
  }
}

std::string joined(const std::vector<std::string>& reasons) {
  std::string text;
  for (const std::string& reason : reasons)
    text += (text.empty() ? "" : "; ") + reason;
  return text;
}

FoundPlacement try_to_place(const MappedPath& run, const std::vector<GnssFix>& fixes,
                            const PlacementMethod& method, Log& log) {
  GeoreferenceRequest request;
  request.run = run.results;
  request.method = method.method;
  request.tilt_sd_deg = tilt_sd_deg(run.levelled_by, straightness(run.trajectory));
  MovableRun movable;
  movable.trajectory = run.trajectory;
  movable.fixes = fixes;
  movable.antenna_in_body = run.antenna_in_body;
  movable.second_antenna_in_body = run.second_antenna_in_body;
  try {
    FoundPlacement found{method.place(request, movable, log), ""};
    if (found.placement->method.empty()) found.placement->method = method.name;
    return found;
  } catch (const InputError& error) {  // the fixes cannot be used: the map is as good as without
    return {std::nullopt, reason_of(error)};
  }
}

// Fills in the frames of a run that was placed; says why where the system does not reach it.
void lay_on_globe(const Placement& placement, const GeoreferenceConfig& config, PlacedMap& map,
                  Log& log) {
  map.place.method = placement.method;
  map.place.enu_from_world = placement.target_from_world;
  map.place.origin = *placement.origin;
  map.place.heights = other_heights(placement);
  map.place.heading_sd_deg = heading_sd_deg(placement);
  map.place.expected_error_m = placement.expected_error_m;
  try {
    map.frames = frames_at(map.place, config, log);
    map.place.on_globe = true;
  } catch (const ConfigError& error) {
    map.place.reason = joined(error.problems());
  }
}

}  // namespace

std::vector<GnssFix> fixes_with_position(const std::vector<GnssFix>& all) {
  std::vector<GnssFix> fixes;
  std::copy_if(all.begin(), all.end(), std::back_inserter(fixes), has_position);
  return fixes;
}

FoundPlacement find_placement(const MappedPath& run, const GeoreferenceConfig& config,
                              GeoreferenceMethod method, Log& log) {
  if (run.fixes.empty()) return {std::nullopt, "the recording has no satellite positions"};
  const std::vector<GnssFix> fixes = fixes_with_position(run.fixes);
  write_rows(run.results, rows_of(fixes, ""));  // a method names them as its input
  if (!config.enabled) return {std::nullopt, "georeference.enabled is off"};
  if (fixes.empty()) return {std::nullopt, "no message of the receiver has a position"};
  return try_to_place(run, fixes, method_of(method), log);
}

PlacedMap place_map(const MappedPath& run, const FoundPlacement& found,
                    const GeoreferenceConfig& config, Log& log) {
  PlacedMap map;
  map.place.reason = found.reason;
  if (run.fixes.empty()) return map;
  map.place.antenna_in_body = run.antenna_in_body;
  map.place.second_antenna_in_body = run.second_antenna_in_body;
  if (found.placement) {
    const Placement& placement = *found.placement;
    std::copy_if(placement.figures.begin(), placement.figures.end(),
                 std::inserter(map.figures, map.figures.end()), [](const auto& figure) {
                   const double* value = std::get_if<double>(&figure.second);
                   return value == nullptr || std::isfinite(*value);
                 });
    map.place.reason = joined(placement.doubts);
    if (!placement.origin) map.place.reason = "the method tells no place on the globe";
    if (map.place.reason.empty()) lay_on_globe(placement, config, map, log);
  }
  if (!map.place.on_globe && config.enabled)
    log.warn("gnss.not_placed", "the map has no place on the globe: " + map.place.reason);
  std::vector<GnssRow> rows =
      rows_of(run.fixes, map.place.on_globe ? "not looked at" : map.place.reason);
  if (found.placement) {
    fill_rows(*found.placement, map.place, rows);
    for (const GnssRow& row : rows) {
      if (row.position_in_world.head<2>().allFinite())
        map.fixes.push_back({row.position_in_world.cast<float>(), row.used});
    }
  }
  write_rows(run.results, rows);
  return map;
}

PlacedMap place_map(const MappedPath& run, const GeoreferenceConfig& config, Log& log) {
  return place_map(run, find_placement(run, config, GeoreferenceMethod::kAuto, log), config, log);
}

}  // namespace understory
