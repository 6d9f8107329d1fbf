#include "understory/pipeline/georeferencing/methods/satellite_placement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "understory/pipeline/georeferencing/gnss_fixes.h"
#include "understory/pipeline/georeferencing/methods/placement_figures.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/source.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace pipeline_constants::georeferencing;

namespace fs = std::filesystem;

LevelledBy levelled_by(const fs::path& folder, const MovableRun& run) {
  if (run.origin) return LevelledBy::kGravity;
  if (fs::exists(folder / "stems.csv.gz")) return LevelledBy::kStems;
  const bool imu = RunJson(folder).find_number("/counts/imu_samples") > 0.0;
  return imu ? LevelledBy::kGravity : LevelledBy::kNothing;
}

double extent_m(const Trajectory& trajectory) {
  Eigen::Vector2d low = trajectory.front().world_from_body.translation().head<2>();
  Eigen::Vector2d high = low;
  for (const StampedPose& pose : trajectory) {
    low = low.cwiseMin(pose.world_from_body.translation().head<2>());
    high = high.cwiseMax(pose.world_from_body.translation().head<2>());
  }
  return (high - low).norm();
}

void doubt(const GeoreferenceRequest& request, const MovableRun& run, const SatelliteFit& fit,
           Placement& placement) {
  const double heading_sd_deg = std::get<double>(placement.figures.at("sd_heading_deg"));
  const double extent = extent_m(run.trajectory);
  if (heading_sd_deg > kMostHeadingSdDeg)
    placement.doubt(fmt::format(
        "the heading is uncertain by {:.1f} degrees (one standard deviation; {:.0f} at most): the "
        "path spans {:.0f} m and the fixes err by {:.1f} m. Take a longer path or a better "
        "receiver",
        heading_sd_deg, kMostHeadingSdDeg, extent, fit.plane_noise_m));
  const double tilt_sd_deg = std::max(std::get<double>(placement.figures.at("sd_turn_east_deg")),
                                      std::get<double>(placement.figures.at("sd_turn_north_deg")));
  if (tilt_sd_deg > kMostHeadingSdDeg)
    placement.doubt(fmt::format(
        "the tilt is uncertain by {:.1f} degrees (one standard deviation; {:.0f} at most): "
        "`understory georeference RUN --method split` takes it from the run",
        tilt_sd_deg, kMostHeadingSdDeg));
  if (!fit.height_known && request.terrain_model.empty())
    placement.doubt("the fixes have no heights: the height of the run is not that of the earth");
  // A carrier that stands is placed by headings: its fixes may scatter over more than its path.
  const bool by_headings = fit.headings && std::isnan(fit.headings->off_rad);
  const double reach_m = by_headings ? std::max(extent, kStandingReachM) : extent;
  // Where many are left out, the others may agree by chance.
  const double misfit_m = fit.left_out_share > kMostLeftOut ? fit.all_plane_rms_m : fit.plane_rms_m;
  if (misfit_m > SatelliteFitConfig().most_misfit * reach_m)
    placement.doubt(fmt::format(
        "the fixes lie {:.1f} m off the path (root mean square), which spans {:.0f} m: are they "
        "fixes of this run?",
        misfit_m, extent));
}

void tell_headings(const UsedHeadings& headings, Placement& placement) {
  placement.figures["gnss_second_antenna_used"] = headings.used ? 1.0 : 0.0;
  placement.figures["gnss_second_antenna_sd_deg"] = headings.turn.sd_rad / kDegree;
  if (std::isfinite(headings.off_rad))
    placement.figures["gnss_second_antenna_off_deg"] = headings.off_rad / kDegree;
}

void tell_figures(const SatelliteFit& fit, Placement& placement) {
  const auto used = std::count_if(fit.fixes.begin(), fit.fixes.end(),
                                  [](const FittedFix& fix) { return fix.used; });
  placement.figures["gnss_fixes"] = static_cast<std::int64_t>(fit.fixes.size());
  placement.figures["gnss_fixes_in_time"] = static_cast<std::int64_t>(fit.fixes_in_time);
  placement.figures["gnss_fixes_used_share"] =
      static_cast<double>(used) / static_cast<double>(fit.fixes.size());
  placement.figures["gnss_plane_rms_m"] = fit.plane_rms_m;
  placement.figures["gnss_plane_error_m"] = fit.plane_noise_m;
  placement.figures["gnss_correlation_s"] = fit.correlation_s;
  placement.figures["gnss_independent_fixes"] = fit.independent_fixes;
  placement.figures["gnss_yaw_deg"] = yaw_of(fit.enu_from_world) * 180.0 / M_PI;
  if (fit.headings) tell_headings(*fit.headings, placement);
  if (fit.height_known) {
    placement.figures["gnss_height_rms_m"] = fit.height_rms_m;
    placement.figures["gnss_height_error_m"] = fit.height_noise_m;
  }
  if (fit.time_offset_sd_s > 0.0) {
    placement.figures["gnss_time_offset_s"] = fit.time_offset_s;
    placement.figures["gnss_time_offset_sd_s"] = fit.time_offset_sd_s;
  }
}

// Where headings count by it. Warns of headings that do not.
std::optional<Eigen::Vector3d> second_antenna(const GeoreferenceRequest& request,
                                              const MovableRun& run,
                                              const std::vector<GnssFix>& fixes, Log& log) {
  const bool own = request.gnss.empty() && !request.antenna_in_body;
  std::optional<Eigen::Vector3d> second = request.second_antenna_in_body;
  if (!second && own) second = run.second_antenna_in_body;
  const bool headings = std::any_of(fixes.begin(), fixes.end(), [](const GnssFix& fix) {
    return std::isfinite(fix.heading_deg);
  });
  if (headings && !second)
    log.warn("gnss.second_antenna",
             "the headings of the fixes are not used: the places of both antennas are not known. "
             "Give body_from_gnss and body_from_second_gnss (--extrinsics FILE of map), or "
             "--antenna-m and --second-antenna-m (georeference)");
  return second;
}

}  // namespace

double tilt_sd_deg(const GeoreferenceRequest& request, const MovableRun& run) {
  if (request.tilt_sd_deg) return *request.tilt_sd_deg;
  return tilt_sd_deg(levelled_by(request.run, run), straightness(run.trajectory));
}

Eigen::Vector3d antenna_of(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const bool own = request.gnss.empty() && run.antenna_in_body.has_value();
  Eigen::Vector3d antenna = request.antenna_in_body.value_or(
      own ? *run.antenna_in_body : Eigen::Vector3d(Eigen::Vector3d::Zero()));
  if (antenna.norm() > kLongestArmM)
    log.warn("recording.lever_arm",
             fmt::format("the antenna is said to be {:.1f} m from the body's origin (--antenna-m): "
                         "check that these are metres and not a place on the earth",
                         antenna.norm()));
  return antenna;
}

SatelliteInput read_satellite_input(const GeoreferenceRequest& request, const MovableRun& run,
                                    Log& log) {
  SatelliteInput input;
  const NamedFixes named = fixes_of_run(request.gnss, request.run, run.fixes, log);
  input.file = named.file;
  input.fixes = named.fixes;
  input.config.pairing.antenna_in_body = antenna_of(request, run, log);
  input.config.pairing.second_antenna_in_body = second_antenna(request, run, input.fixes, log);
  input.config.pairing.time_offset_s = request.time_offset_s;
  input.config.split.time_offset_sd_s = request.time_offset_sd_s;
  input.config.split.robust = input.config.rigid.robust = request.path.robust;
  input.config.split.tilt_sd_deg = tilt_sd_deg(request, run);
  return input;
}

void warn_of_headings(const UsedHeadings& headings, Log& log) {
  if (headings.used) return;
  log.warn("gnss.second_antenna_contradicts",
           fmt::format("the headings of the second antenna are left out: they differ by {:.1f} "
                       "degrees from those of the positions, which expect {:.1f} (one standard "
                       "deviation). Check the places of the antennas, and whether they are swapped",
                       headings.off_rad / kDegree, headings.off_sd_rad / kDegree));
}

Placement placement_of(const GeoreferenceRequest& request, const MovableRun& run,
                       const SatelliteInput& input, const SatelliteFit& fit,
                       const std::string& method, Log& log) {
  if (!fit.found) throw InputError(input.file.string(), "", fit.reason);
  if (fit.swapped)
    throw InputError(input.file.string(), "",
                     fmt::format("latitude and longitude seem to be swapped: as they stand the "
                                 "fixes lie {:.1f} m off the path, swapped less than half of that",
                                 fit.plane_rms_m));
  Placement placement;
  placement.method = method;
  placement.target_from_world = fit.enu_from_world;
  placement.origin = fit.origin;
  placement.covariance = fit.covariance;
  placement.expected_error_m = fit.expected_error_m;
  tell_figures(fit, placement);
  tell_placement(run.trajectory, placement);
  doubt(request, run, fit, placement);
  if (fit.headings) warn_of_headings(*fit.headings, log);
  placement.gnss = rows_of(fit.fixes, "far off the others, or of another time");
  placement.summary = fmt::format(
      "{}: {} fixes at times of the path, {:.2f} m off it in the plane (root mean square), worth "
      "{:.0f} independent {}\nexpected error {:.2f} m over the path; one standard deviation: {}",
      method, fit.fixes_in_time, fit.plane_rms_m, fit.independent_fixes,
      std::lround(fit.independent_fixes) == 1 ? "fix" : "fixes", fit.expected_error_m,
      precision_of(placement));
  if (request.gnss.empty())
    placement.inputs.push_back(hash_input(input.file));
  else
    placement.inputs = hash_inputs(request.gnss, log, request.progress);
  return placement;
}

}  // namespace understory
