#include "understory/pipeline/georeferencing/gnss_in_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "understory/georeference/gnss_fit.h"
#include "understory/pipeline/georeferencing/placement_figures.h"

namespace understory {
namespace {

// Poses of the scans after their keyframes have moved. Between keyframes they move with the one
// before them.
Trajectory moved_path(const SolvedRun& solved, const std::vector<Pose>& moved) {
  Trajectory trajectory;
  for (const StampedPose& pose : solved.trajectory) {
    const auto after = std::upper_bound(solved.stamps.begin(), solved.stamps.end(), pose.stamp);
    const auto k = static_cast<std::size_t>(
        after == solved.stamps.begin() ? 0 : after - solved.stamps.begin() - 1);
    trajectory.push_back({pose.stamp, moved[k] * solved.graph.world_from_keyframe[k].inverse() *
                                          pose.world_from_body});
  }
  return trajectory;
}

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
  placement.figures["gnss_slow_plane_m"] = path.errors.slow_plane_m;
  placement.figures["gnss_fast_plane_m"] = path.errors.fast_plane_m;
  placement.figures["gnss_slow_height_m"] = path.errors.slow_height_m;
  placement.figures["gnss_fast_height_m"] = path.errors.fast_height_m;
  placement.figures["gnss_correlation_s"] = path.errors.correlation_s;
}

// By the larger of both: the fit integrates what is not known of the receiver's errors out, the
// graph takes one set of them.
double larger(double fitted, double by_graph) {
  return std::isfinite(fitted) ? std::max(fitted, by_graph) : by_graph;
}

Placement placement_of(const SolvedRun& solved, const FusedPath& path, const GnssUseConfig& config,
                       const PairingConfig& pairing, const Placement& rigid) {
  Placement placement = rigid;
  const bool fused = config.use == GnssUse::kFuse;
  placement.method = fused ? "fuse" : "rigid";
  tell_figures(path, placement);
  placement.expected_error_m = larger(rigid.expected_error_m, path.expected_error_m);
  placement.figures["expected_error_m"] = placement.expected_error_m;
  const Trajectory moved = moved_path(solved, path.enu_from_keyframe);
  tell_residuals(moved, pairing, placement);
  const Pose motion =
      path.enu_from_keyframe.front() * solved.graph.world_from_keyframe.front().inverse();
  placement.figures["gnss_yaw_deg"] = yaw_of(motion) * 180.0 / std::numbers::pi;
  if (fused) {
    // The run's frame is east, north, up now: what was uncertain before that motion is after it.
    const Matrix6d turn = motion.adjoint();
    placement.covariance = turn * rigid.covariance * turn.transpose();
    placement.target_from_world = Pose();
    placement.figures["gnss_bent_m"] = path.bent_m;
    placement.figures["gnss_odometry_scale"] = path.odometry_scale;
  } else {
    placement.target_from_world = motion;
  }
  tell_placement(fused ? moved : solved.trajectory, placement);
  return placement;
}

}  // namespace

void describe(ConfigTable& table, GnssUseConfig& config) {
  table.add_enum("use", config.use,
                 {{"georeference", GnssUse::kGeoreference},
                  {"rigid", GnssUse::kRigid},
                  {"fuse", GnssUse::kFuse}},
                 "what satellite positions are for: lay the finished map on the globe; the same by "
                 "one motion beside the graph; or bend the path as factors of the graph");
  table.section("fusion", [&] { describe(table, config.path); });
}

RunWithPositions use_positions(const MappedPath& run, const SolvedRun& solved,
                               const GeoreferenceConfig& georeference, const GnssUseConfig& config,
                               Log& log) {
  RunWithPositions result;
  result.found = find_placement(run, georeference, log);
  if (run.fixes.empty()) return result;
  const std::string what = config.use == GnssUse::kFuse
                               ? "the graph is without positions by satellites: "
                               : "no motion was estimated beside the graph: ";
  if (!result.found.placement || !result.found.placement->doubts.empty() ||
      !result.found.placement->origin) {
    log.warn("gnss.not_fused",
             what + (result.found.placement && !result.found.placement->doubts.empty()
                         ? result.found.placement->doubts.front()
                         : result.found.reason));
    return result;
  }
  PairingConfig pairing;
  pairing.antenna_in_body = run.antenna_in_body.value_or(Eigen::Vector3d::Zero());
  SplitFitConfig split;
  if (!run.level) split.tilt_sd_deg = split.unlevel_tilt_sd_deg;
  const auto method = config.use == GnssUse::kFuse ? fuse_path : move_path;
  const FusedPath path =
      method(solved, fixes_with_position(run.fixes), result.found.placement->target_from_world,
             pairing, split, config.path);
  if (!path.found) {
    log.warn("gnss.not_fused", what + path.reason);
    return result;
  }
  result.found.placement = placement_of(solved, path, config, pairing, *result.found.placement);
  if (config.use == GnssUse::kFuse) result.world_from_keyframe = path.enu_from_keyframe;
  return result;
}

}  // namespace understory
