#include "understory/pipeline/georeferencing/gnss_in_graph.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/pipeline/georeferencing/methods/placement_figures.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"

namespace understory {
namespace {

void tell_residuals(const Trajectory& path, const PairingConfig& pairing, Placement& placement) {
  double plane = 0.0;
  double height = 0.0;
  double fixes = 0.0;
  for (GnssRow& row : placement.gnss) {
    const auto antenna = antenna_place(path, pairing.antenna_in_body, row.fix.stamp);
    if (!antenna) continue;
    row.residual = row.position_in_world - *antenna;
    plane += row.residual.head<2>().squaredNorm();
    height += row.residual.z() * row.residual.z();
    fixes += 1.0;
  }
  if (fixes == 0.0) return;
  placement.figures["gnss_plane_rms_m"] = std::sqrt(plane / fixes);
  if (placement.figures.contains("gnss_height_rms_m") && std::isfinite(height))
    placement.figures["gnss_height_rms_m"] = std::sqrt(height / fixes);
}

void tell_figures(const FusedPath& path, Placement& placement) {
  placement.figures["gnss_factors"] = static_cast<std::int64_t>(path.positions);
  placement.figures["gnss_factor_weight"] = path.weight;
  placement.figures["gnss_bent_m"] = path.bent_m;
  placement.figures["gnss_odometry_scale"] = path.odometry_scale;
  placement.figures["gnss_slow_plane_m"] = path.errors.slow_plane_m;
  placement.figures["gnss_fast_plane_m"] = path.errors.fast_plane_m;
  placement.figures["gnss_slow_height_m"] = path.errors.slow_height_m;
  placement.figures["gnss_fast_height_m"] = path.errors.fast_height_m;
  placement.figures["gnss_correlation_s"] = path.errors.correlation_s;
}

// The run's frame is east, north, up now.
Placement placement_of(const SolvedRun& solved, const FusedPath& path, const PairingConfig& pairing,
                       const Placement& rigid) {
  Placement placement = rigid;
  placement.method = "fuse";
  tell_figures(path, placement);
  placement.expected_error_m = path.expected_error_m;
  placement.figures["expected_error_m"] = path.expected_error_m;
  tell_residuals(path.enu_from_body, pairing, placement);
  const Pose motion =
      path.enu_from_keyframe.front() * solved.graph.world_from_keyframe.front().inverse();
  placement.figures["gnss_yaw_deg"] = yaw_of(motion) * 180.0 / std::numbers::pi;
  placement.covariance = path.covariance;
  placement.target_from_world = Pose();
  tell_placement(path.enu_from_body, placement);
  return placement;
}

}  // namespace

void describe(ConfigTable& table, GnssUseConfig& config) {
  table.add_enum(
      "use", config.use,
      {{"georeference", GnssUse::kGeoreference},
       {"rigid", GnssUse::kRigid},
       {"fuse", GnssUse::kFuse}},
      "georeference: fixes lay the finished map on the globe, by the best method. rigid: the same "
      "by split. fuse: they correct the path in the graph");
  table.section("fusion", [&] { describe(table, config.path); });
}

RunWithPositions use_positions(const MappedPath& run, const SolvedRun& solved,
                               const GeoreferenceConfig& georeference, const GnssUseConfig& config,
                               Log& log) {
  RunWithPositions result;
  const bool rigid = config.use == GnssUse::kRigid;
  result.found = find_placement(
      run, georeference, rigid ? GeoreferenceMethod::kSplit : GeoreferenceMethod::kAuto, log);
  if (run.fixes.empty() || rigid) return result;
  const std::string what = "the graph is without positions by satellites: ";
  const std::optional<Placement>& placement = result.found.placement;
  if (!placement || !placement->doubts.empty() || !placement->origin) {
    const bool doubted = placement && !placement->doubts.empty();
    log.warn("gnss.not_fused", what + (doubted ? placement->doubts.front() : result.found.reason));
    return result;
  }
  PairingConfig pairing;
  pairing.antenna_in_body = run.antenna_in_body.value_or(Eigen::Vector3d::Zero());
  pairing.second_antenna_in_body = run.second_antenna_in_body;
  SplitFitConfig split;
  split.tilt_sd_deg = tilt_sd_deg(run.levelled_by, straightness(run.trajectory));
  const FusedPath path = fuse_path(solved, fixes_with_position(run.fixes),
                                   placement->target_from_world, pairing, split, config.path);
  if (!path.found) {
    log.warn("gnss.not_fused", what + path.reason);
    return result;
  }
  result.found.placement = placement_of(solved, path, pairing, *placement);
  result.world_from_keyframe = path.enu_from_keyframe;
  return result;
}

}  // namespace understory
