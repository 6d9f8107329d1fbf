#include "understory/georeference/satellites/fused_path.h"

#include <algorithm>
#include <cmath>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace georeference_constants::fused_path;

using Eigen::Vector3d;

// The positions of one run and how they err, as both functions need them.
struct Positions {
  std::string reason;  // why there are none
  std::vector<GnssObservation> observations;
  GnssErrors errors;
};

GnssErrors errors_of(const SplitFit& seen, double step_s) {
  GnssErrors errors;
  errors.slow_plane_m = seen.plane_noise.slow_sd_m();
  errors.fast_plane_m = std::max(seen.plane_noise.white_fast_sd_m(step_s), kLeastErrorM);
  errors.correlation_s = seen.plane_noise.correlation_s();
  if (seen.height_known) {
    errors.slow_height_m = seen.height_noise.slow_sd_m();
    errors.fast_height_m = std::max(seen.height_noise.white_fast_sd_m(step_s), kLeastErrorM);
  }
  return errors;
}

// A receiver that states decimetres and does not jump by more from pair to pair is as good as it
// states (RTK in the open). What is smooth in the residuals is then the error of the path. Under
// trees a receiver that states too little jumps, too.
GnssErrors errors_of_good_receiver(const SplitFit& seen, const GnssErrors& shown,
                                   const SplitFitConfig& config) {
  const double plane_m = seen.plane_times.stated_sd_m;
  if (plane_m > kGoodReceiverM || shown.fast_plane_m > plane_m) return shown;
  GnssErrors errors = shown;
  errors.slow_plane_m = std::min(shown.slow_plane_m, plane_m);
  errors.fast_plane_m = std::max(shown.fast_plane_m, config.plane.fast_share * plane_m);
  if (!seen.height_known) return errors;
  const double height_m = seen.height_times.stated_sd_m;
  errors.slow_height_m = std::min(shown.slow_height_m, height_m);
  errors.fast_height_m = std::max(shown.fast_height_m, config.height.fast_share * height_m);
  return errors;
}

// Each pair at the keyframe before it.
std::vector<GnssObservation> observations_of(const SolvedRun& run,
                                             const std::vector<SatellitePair>& pairs,
                                             TimeNs first_fix, const SplitFit& seen) {
  std::vector<GnssObservation> observations;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const SatellitePair& pair = pairs[k];
    GnssObservation one;
    one.stamp = first_fix + from_seconds(pair.time_s);
    const auto after = std::upper_bound(run.stamps.begin(), run.stamps.end(), one.stamp);
    const auto keyframe = after == run.stamps.begin() ? 0 : after - run.stamps.begin() - 1;
    one.keyframe = static_cast<int>(keyframe);
    one.antenna_in_keyframe =
        run.graph.world_from_keyframe[static_cast<std::size_t>(keyframe)].inverse() *
        pair.antenna_in_world;
    one.position_in_enu = pair.fix_in_enu;
    one.has_height = seen.height_known;
    if (seen.headings && seen.headings->used && std::isfinite(pair.turn_rad)) {
      const Pose& world_from_keyframe =
          run.graph.world_from_keyframe[static_cast<std::size_t>(keyframe)];
      one.direction_in_keyframe = world_from_keyframe.rotation().conjugate() * Vector3d::UnitX();
      one.azimuth_rad = pair.turn_rad;
      // All together know the turn as well as the fit says.
      one.azimuth_sd_rad =
          seen.headings->turn.sd_rad * std::sqrt(static_cast<double>(seen.headings->turn.pairs));
    }
    const auto row = static_cast<Eigen::Index>(k);
    one.plane_scale = seen.plane_noise.relative_slow(seen.plane_times.scale(row));
    one.extra_plane_m = seen.plane_times.extra_sd_m(row);
    if (seen.height_known) {
      one.height_scale = seen.height_noise.relative_slow(seen.height_times.scale(row));
      one.extra_height_m = seen.height_times.extra_sd_m(row);
    }
    observations.push_back(one);
  }
  return observations;
}

Positions positions_of(const SolvedRun& run, const std::vector<GnssFix>& fixes,
                       PairingConfig pairing, const SplitFitConfig& split,
                       const FusedPathConfig& config) {
  Positions positions;
  pairing.most_pairs = static_cast<std::size_t>(config.most_positions);
  const SatellitePairs all = pair_by_time(run.trajectory, fixes, pairing);
  positions.reason = all.reason;
  if (!positions.reason.empty()) return positions;
  const std::vector<SatellitePair> pairs = of_one_kind(all.pairs);
  const SplitFit seen = fit_split(pairs, split);
  positions.reason = seen.reason;
  if (!seen.found) return positions;
  const double step_s =
      (pairs.back().time_s - pairs.front().time_s) / static_cast<double>(pairs.size() - 1);
  positions.errors = errors_of_good_receiver(seen, errors_of(seen, step_s), split);
  const TimeNs first = all.first_fix + from_seconds(pairing.time_offset_s);
  positions.observations = observations_of(run, pairs, first, seen);
  return positions;
}

GnssFusionConfig with_tilt(const FusedPathConfig& config, const SplitFitConfig& split) {
  GnssFusionConfig fusion = config.fusion;
  fusion.tilt_sd_deg = split.tilt_sd_deg;
  return fusion;
}

// The solved graph again, with edges that say what its poses say.
PoseGraphProblem settled(const PoseGraphProblem& solved, double odometry_scale) {
  PoseGraphProblem graph = solved;
  const auto between = [&](PoseEdge& edge) {
    edge.from_from_to = solved.world_from_keyframe[static_cast<std::size_t>(edge.from)].inverse() *
                        solved.world_from_keyframe[static_cast<std::size_t>(edge.to)];
  };
  for (PoseEdge& edge : graph.odometry) {
    between(edge);
    edge.covariance *= odometry_scale * odometry_scale;
  }
  for (PoseEdge& edge : graph.loops)
    between(edge);
  graph.tilts.clear();  // the poses say that, too
  return graph;
}

void take_over(const GnssFusionResult& solved, const Positions& positions, FusedPath& path) {
  path.found = solved.converged;
  path.reason = solved.reason;
  path.errors = positions.errors;
  path.positions = positions.observations.size();
  for (const double weight : solved.weight)
    path.weight += weight / static_cast<double>(solved.weight.size());
}

// How far places lie off the same ones by a rigid motion, which is fitted to the middle and to the
// heading.
double bent_m(const std::vector<Pose>& bent, const std::vector<Pose>& straight) {
  Eigen::Matrix3Xd to(3, static_cast<Eigen::Index>(bent.size()));
  Eigen::Matrix3Xd from(3, to.cols());
  for (Eigen::Index k = 0; k < to.cols(); ++k) {
    to.col(k) = bent[static_cast<std::size_t>(k)].translation();
    from.col(k) = straight[static_cast<std::size_t>(k)].translation();
  }
  const Vector3d to_middle = to.rowwise().mean();
  const Vector3d from_middle = from.rowwise().mean();
  to.colwise() -= to_middle;
  from.colwise() -= from_middle;
  const double along = (to.topRows<2>().cwiseProduct(from.topRows<2>())).sum();
  const double across =
      (from.row(0).cwiseProduct(to.row(1)) - from.row(1).cwiseProduct(to.row(0))).sum();
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(std::atan2(across, along), Vector3d::UnitZ()).toRotationMatrix();
  return std::sqrt((to - turn * from).squaredNorm() / static_cast<double>(to.cols()));
}

// Poses of the scans after their keyframes have moved. Between keyframes they move with the one
// before them.
std::vector<StampedPose> moved_scans(const SolvedRun& run, const std::vector<Pose>& moved) {
  std::vector<StampedPose> scans;
  for (const StampedPose& pose : run.trajectory) {
    const auto after = std::upper_bound(run.stamps.begin(), run.stamps.end(), pose.stamp);
    const auto k =
        static_cast<std::size_t>(after == run.stamps.begin() ? 0 : after - run.stamps.begin() - 1);
    scans.push_back(
        {pose.stamp, moved[k] * run.graph.world_from_keyframe[k].inverse() * pose.world_from_body});
  }
  return scans;
}

// The path as a whole once more, by the fit that knows more kinds of errors.
void lay_on_fixes(const SolvedRun& run, const std::vector<GnssFix>& fixes,
                  const PairingConfig& pairing, const SplitFitConfig& split, FusedPath& path) {
  path.enu_from_body = moved_scans(run, path.enu_from_keyframe);
  const SatellitePairs all = pair_by_time(path.enu_from_body, fixes, pairing);
  const SplitFit fit = fit_split(of_one_kind(all.pairs), split);
  UNDERSTORY_CHECK(fit.found);  // as it was before the path was bent
  for (Pose& pose : path.enu_from_keyframe)
    pose = fit.enu_from_world * pose;
  std::vector<Vector3d> places;
  for (StampedPose& pose : path.enu_from_body) {
    pose.world_from_body = fit.enu_from_world * pose.world_from_body;
    places.emplace_back(pose.world_from_body.translation());
  }
  path.covariance = right_from_spread(fit.spread, Pose(), fit.middle);
  path.expected_error_m = expected_error_m(fit.spread, fit.middle, places);
}

}  // namespace

void describe(ConfigTable& table, FusedPathConfig& config) {
  describe(table, config.fusion);
  table.add(
      "odometry_scale", config.odometry_scale, {1e-3, 100.0}, "",
      "factor on the odometry's standard deviations in the graph, before the positions are used");
  table.add("odometry_scale_log", config.odometry_scale_log, {0.0, 10.0}, "",
            "standard deviation of the logarithm of that factor; 0: the factor is kept");
  table.add("most_positions", config.most_positions, {10, 100000}, "",
            "most positions in the graph; more are averaged over longer intervals");
}

FusedPath fuse_path(const SolvedRun& run, const std::vector<GnssFix>& fixes,
                    const Pose& enu_from_world, const PairingConfig& pairing,
                    const SplitFitConfig& split, const FusedPathConfig& config) {
  UNDERSTORY_CHECK(run.stamps.size() == run.graph.world_from_keyframe.size());
  FusedPath path;
  const Positions positions = positions_of(run, fixes, pairing, split, config);
  path.reason = positions.reason;
  if (!path.reason.empty()) return path;
  double best = 0.0;
  for (const double steps : kScaleSteps) {
    if (config.odometry_scale_log <= 0.0 && steps != 0.0) break;
    const double scale = config.odometry_scale * std::exp(steps);
    const GnssFusionResult solved =
        fuse_gnss(settled(run.graph, scale), run.loop_used, positions.observations, enu_from_world,
                  positions.errors, with_tilt(config, split));
    if (!solved.converged) {
      if (!path.found) path.reason = solved.reason;
      continue;
    }
    const double off = steps == 0.0 ? 0.0 : steps / config.odometry_scale_log;
    const double evidence = solved.log_evidence - 0.5 * off * off;
    if (path.found && evidence <= best) break;  // it only falls from here
    best = evidence;
    path = {};
    take_over(solved, positions, path);
    path.enu_from_keyframe = solved.enu_from_keyframe;
    path.odometry_scale = scale;
  }
  if (!path.found) return path;
  path.bent_m = bent_m(path.enu_from_keyframe, run.graph.world_from_keyframe);
  lay_on_fixes(run, fixes, pairing, split, path);
  return path;
}

}  // namespace understory
