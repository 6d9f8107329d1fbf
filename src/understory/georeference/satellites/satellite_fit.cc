#include "understory/georeference/satellites/satellite_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "understory/geometry/matrix_inverse.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/sensor/fix_position.h"

namespace understory {
namespace {

using namespace georeference_constants::interpolation;
using namespace georeference_constants::satellite_fit;

using Eigen::MatrixXd;
using Eigen::Vector3d;

// Errors of the estimate by errors of the measurements: one column a pair, for each of D rows.
template <int D>
using Gains = std::array<MatrixXd, D>;

template <int D>
struct Linearised {
  std::vector<Eigen::Matrix<double, D, 6>> jacobian;
  std::vector<Eigen::Matrix<double, D, D>> information;

  [[nodiscard]] Gains<D> gains() const {
    Matrix6d hessian = Matrix6d::Zero();
    for (std::size_t k = 0; k < jacobian.size(); ++k)
      hessian += jacobian[k].transpose() * information[k] * jacobian[k];
    const Matrix6d covariance = SymmetricSolver<6>(hessian).inverse();
    Gains<D> result;
    result.fill(MatrixXd::Zero(6, static_cast<Eigen::Index>(jacobian.size())));
    for (std::size_t k = 0; k < jacobian.size(); ++k) {
      const Eigen::Matrix<double, 6, D> gain =
          covariance * (jacobian[k].transpose() * information[k]);
      for (int row = 0; row < D; ++row)
        result[static_cast<std::size_t>(row)].col(static_cast<Eigen::Index>(k)) = gain.col(row);
    }
    return result;
  }
};

std::vector<PlacePair> place_pairs(const std::vector<SatellitePair>& pairs, double path_sd_m) {
  std::vector<PlacePair> result;
  for (const SatellitePair& pair : pairs)
    result.push_back({pair.antenna_in_world, pair.fix_in_enu, pair.covariance,
                      path_sd_m * path_sd_m * Eigen::Matrix3d::Identity(), 1.0});
  return result;
}

// Covariance of a fit to positions, right perturbation, under the errors that the split fit saw.
Matrix6d position_covariance(const std::vector<PlacePair>& pairs, const RigidFit& fit,
                             bool weighted, const SplitFit& seen) {
  Linearised<3> linear;
  const Eigen::Matrix3d r = fit.target_from_source.rotation_matrix();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    linear.jacobian.push_back(place_residual_jacobian(pairs[k], fit.target_from_source));
    const Eigen::Matrix3d sum =
        pairs[k].target_covariance + r * pairs[k].source_covariance * r.transpose();
    linear.information.push_back(
        fit.weight[k] * (weighted ? Eigen::Matrix3d(sum.inverse()) : Eigen::Matrix3d::Identity()));
  }
  const Gains<3> gains = linear.gains();
  const MatrixXd plane = noise_covariance(seen.plane_times, seen.plane_noise);
  const MatrixXd height = noise_covariance(seen.height_times, seen.height_noise);
  return gains[0] * plane * gains[0].transpose() + gains[1] * plane * gains[1].transpose() +
         gains[2] * height * gains[2].transpose();
}

// The pose of the body at a time, on the screw between its neighbours; P4 (34).
std::optional<Pose> pose_at(const std::vector<StampedPose>& trajectory, TimeNs stamp) {
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), stamp,
                       [](const StampedPose& pose, TimeNs t) { return pose.stamp < t; });
  if (after == trajectory.end()) return std::nullopt;
  if (after->stamp == stamp) return after->world_from_body;
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap = to_seconds(after->stamp - before->stamp);
  if (gap > kGapS) return std::nullopt;
  return interpolate(before->world_from_body, after->world_from_body,
                     to_seconds(stamp - before->stamp) / gap);
}

Matrix6d diagonal(double turn_sd, double shift_sd) {
  Vector6d sd;
  sd << Vector3d::Constant(turn_sd), Vector3d::Constant(shift_sd);
  return sd.cwiseAbs2().asDiagonal();
}

struct SixFit {
  RigidFit fit;
  Matrix6d covariance = Matrix6d::Zero();
};

// P4 (45-52). Positions that were smoothed err as the fixes do. Attitudes keep the error of their
// covariance over the whole path, since it is that of biases and of the heading.
SixFit fit_six(const std::vector<StampedPose>& trajectory,
               const std::vector<SmoothedPose>& smoothed, const SplitFit& seen,
               const SatelliteFitConfig& config) {
  SixFit six;
  std::vector<FullPair> pairs;
  Linearised<6> linear;
  NoisyTimes times;
  const Matrix6d own = diagonal(config.path_sd_deg * M_PI / 180.0, config.path_sd_m);
  for (const SmoothedPose& pose : smoothed) {
    const auto world_from_body = pose_at(trajectory, pose.stamp);
    if (!world_from_body) continue;
    pairs.push_back({*world_from_body, pose.enu_from_body, own, pose.covariance, 1.0});
    times.time_s.push_back(to_seconds(pose.stamp - smoothed.front().stamp));
  }
  six.fit = fit_poses(pairs, seen.enu_from_world, config.rigid);
  if (!six.fit.found) return six;
  Matrix6d attitude = Matrix6d::Zero();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    // Rows in the target's axes, as the errors are: they keep their direction while the body turns.
    Matrix6d turn = Matrix6d::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() =
        pairs[k].target_from_body.rotation_matrix();
    const Matrix6d information =
        inverse_matrix(pairs[k].target_covariance + pairs[k].source_covariance);
    linear.jacobian.push_back(turn * pose_residual_jacobian(pairs[k], six.fit.target_from_source));
    linear.information.push_back(six.fit.weight[k] * turn * information * turn.transpose());
    attitude +=
        turn * pairs[k].target_covariance * turn.transpose() / static_cast<double>(pairs.size());
  }
  const Gains<6> gains = linear.gains();
  times.scale = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(pairs.size()));
  times.extra_sd_m = Eigen::VectorXd::Zero(times.scale.size());
  const MatrixXd plane = noise_covariance(times, seen.plane_noise);
  const MatrixXd height = noise_covariance(times, seen.height_noise);
  for (std::size_t row = 0; row < 3; ++row) {
    const Vector6d sum = gains[row].rowwise().sum();
    six.covariance += attitude(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(row)) *
                      sum * sum.transpose();
  }
  six.covariance += gains[3] * plane * gains[3].transpose() +
                    gains[4] * plane * gains[4].transpose() +
                    gains[5] * height * gains[5].transpose();
  return six;
}

// Root mean square in the plane after the best turn and shift in it. No mirror: the motion stays in
// the plane.
double plane_misfit_m(const std::vector<SatellitePair>& pairs) {
  Eigen::Vector2d source = Eigen::Vector2d::Zero();
  Eigen::Vector2d target = Eigen::Vector2d::Zero();
  const auto n = static_cast<double>(pairs.size());
  for (const SatellitePair& pair : pairs) {
    source += pair.antenna_in_world.head<2>() / n;
    target += pair.fix_in_enu.head<2>() / n;
  }
  double along = 0.0;
  double across = 0.0;
  double squares = 0.0;
  for (const SatellitePair& pair : pairs) {
    const Eigen::Vector2d s = pair.antenna_in_world.head<2>() - source;
    const Eigen::Vector2d t = pair.fix_in_enu.head<2>() - target;
    along += s.dot(t);
    across += s.x() * t.y() - s.y() * t.x();
    squares += s.squaredNorm() + t.squaredNorm();
  }
  return std::sqrt(std::max(0.0, squares - 2.0 * std::hypot(along, across)) / n);
}

// A path that fits much better with both angles swapped was written the wrong way round.
bool fit_swapped(const std::vector<StampedPose>& trajectory, std::vector<GnssFix> fixes,
                 const SatelliteFitConfig& config, double plane_rms_m) {
  if (plane_rms_m < kLeastMisfitM) return false;
  for (GnssFix& fix : fixes) {
    if (std::abs(fix.longitude_deg) > 90.0) return false;
    std::swap(fix.latitude_deg, fix.longitude_deg);
  }
  const SatellitePairs pairs = pair_by_time(trajectory, fixes, config.pairing);
  return plane_misfit_m(pairs.pairs) < kClearlyBetter * plane_rms_m;
}

void tell_residuals(const std::vector<SatellitePair>& pairs, const SplitFit& seen,
                    SatelliteFit& fit) {
  double plane = 0.0;
  double height = 0.0;
  double all = 0.0;
  double n = 0.0;
  // Pairs far off the others hardly count for the fit, and do not tell how good it is.
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const SatellitePair& pair = pairs[i];
    const Vector3d r = pair.fix_in_enu - fit.enu_from_world * pair.antenna_in_world;
    all += r.head<2>().squaredNorm();
    if (seen.far_off[i] != 0) continue;
    plane += r.head<2>().squaredNorm();
    height += r.z() * r.z();
    n += 1.0;
  }
  const auto pairs_at_all = static_cast<double>(pairs.size());
  fit.left_out_share = 1.0 - n / pairs_at_all;
  fit.all_plane_rms_m = std::sqrt(all / pairs_at_all);
  fit.plane_rms_m = std::sqrt(plane / n);
  fit.height_rms_m = seen.height_known ? std::sqrt(height / n) : std::nan("");
  fit.plane_noise_m = std::hypot(seen.plane_noise.slow_sd_m(), seen.plane_noise.fast_sd_m());
  fit.height_noise_m =
      seen.height_known ? std::hypot(seen.height_noise.slow_sd_m(), seen.height_noise.fast_sd_m())
                        : std::nan("");
  fit.correlation_s = seen.plane_noise.correlation_s();
  fit.independent_fixes =
      2.0 * fit.plane_noise_m * fit.plane_noise_m / (seen.spread(3, 3) + seen.spread(4, 4));
  fit.time_offset_s = seen.time_offset_s;
  fit.time_offset_sd_s = seen.time_offset_sd_s;
  fit.height_known = seen.height_known;
}

void tell_fixes(const std::vector<StampedPose>& trajectory, const std::vector<GnssFix>& fixes,
                const SatelliteFitConfig& config, const SatellitePairs& pairs, const SplitFit& seen,
                SatelliteFit& fit) {
  const EastNorthUp frame(*pairs.origin);
  const TimeNs shift = from_seconds(config.pairing.time_offset_s + seen.time_offset_s);
  TimeNs first = fixes.front().stamp;
  for (const GnssFix& fix : fixes)
    first = std::min(first, fix.stamp);
  for (const GnssFix& fix : fixes) {
    FittedFix one;
    one.fix = fix;
    const bool has_height = std::isfinite(fix.height_m);
    one.position_in_enu =
        frame.from_place({fix.latitude_deg, fix.longitude_deg, has_height ? fix.height_m : 0.0});
    if (!has_height) one.position_in_enu.z() = std::nan("");
    const auto place = antenna_place(trajectory, config.pairing.antenna_in_body, fix.stamp + shift);
    if (place) {
      one.residual = one.position_in_enu - fit.enu_from_world * *place;
      const double time_s = to_seconds(fix.stamp - first);
      auto pair = std::lower_bound(pairs.pairs.begin(), pairs.pairs.end(), time_s,
                                   [](const SatellitePair& a, double t) { return a.time_s < t; });
      if (pair == pairs.pairs.end() ||
          (pair != pairs.pairs.begin() && time_s - std::prev(pair)->time_s < pair->time_s - time_s))
        --pair;
      one.used = is_on_globe(fix) && !pairs.left_out.contains(fix.stamp) &&
                 seen.far_off[static_cast<std::size_t>(pair - pairs.pairs.begin())] == 0;
    }
    fit.fixes.push_back(one);
  }
}

void tell_error(const std::vector<StampedPose>& trajectory, SatelliteFit& fit) {
  std::vector<Vector3d> places;
  for (const StampedPose& pose : trajectory)
    places.emplace_back(fit.enu_from_world * pose.world_from_body.translation());
  for (const Vector3d& place : places)
    fit.middle += place / static_cast<double>(places.size());
  fit.spread = spread_from_right(fit.covariance, fit.enu_from_world, fit.middle);
  fit.expected_error_m = expected_error_m(fit.spread, fit.middle, places);
}

// Into `fit`: motion and covariance by the method. Empty if all is well, else why not.
std::string fit_by(SatelliteMethod method, const std::vector<StampedPose>& trajectory,
                   const std::vector<SatellitePair>& pairs,
                   const std::vector<SmoothedPose>& smoothed, const SatelliteFitConfig& config,
                   const SplitFit& seen, SatelliteFit& fit) {
  if (method == SatelliteMethod::kSplit) {
    fit.enu_from_world = seen.enu_from_world;
    fit.covariance = right_from_spread(seen.spread, seen.enu_from_world, seen.middle);
    fit.headings = seen.headings;
    return "";
  }
  if (seen.headings && std::isnan(seen.headings->off_rad))
    return "this method needs a longer path, whose positions tell the heading: use split";
  if (!seen.height_known) return "this method needs fixes with heights: use split";
  if (method == SatelliteMethod::kFit6) {
    const SixFit six = fit_six(trajectory, smoothed, seen, config);
    fit.enu_from_world = six.fit.target_from_source;
    fit.covariance = six.covariance;
    return six.fit.reason;
  }
  const std::vector<PlacePair> places = place_pairs(pairs, config.path_sd_m);
  RigidFit rigid = fit_closed(places);
  const bool weighted = method == SatelliteMethod::kFit3;
  if (weighted && rigid.found)
    rigid = fit_positions(places, rigid.target_from_source, config.rigid);
  if (!rigid.found) return rigid.reason;
  fit.enu_from_world = rigid.target_from_source;
  fit.covariance = position_covariance(places, rigid, weighted, seen);
  return "";
}

}  // namespace

std::vector<SatelliteFit> fits_to_satellites(const std::vector<StampedPose>& trajectory,
                                             const std::vector<GnssFix>& fixes,
                                             const std::vector<SatelliteMethod>& methods,
                                             const SatelliteFitConfig& config,
                                             const std::vector<SmoothedPose>& smoothed) {
  SatelliteFit common;
  SatellitePairs pairs = pair_by_time(trajectory, fixes, config.pairing);
  common.origin = pairs.origin;
  common.fixes_in_time = pairs.fixes_in_time;
  common.reason = pairs.reason;
  SplitFit seen;
  if (common.reason.empty()) {
    pairs.pairs = of_one_kind(pairs.pairs);
    seen = fit_split(pairs.pairs, config.split);
    common.reason = seen.reason;
  }
  std::vector<SatelliteFit> fits(methods.size(), common);
  if (!common.reason.empty()) return fits;
  for (std::size_t k = 0; k < methods.size(); ++k) {
    SatelliteFit& fit = fits[k];
    fit.reason = fit_by(methods[k], trajectory, pairs.pairs, smoothed, config, seen, fit);
    if (!fit.reason.empty()) continue;
    fit.found = true;
    tell_error(trajectory, fit);
    tell_residuals(pairs.pairs, seen, fit);
    fit.swapped = fit_swapped(trajectory, fixes, config, fit.all_plane_rms_m);
    tell_fixes(trajectory, fixes, config, pairs, seen, fit);
  }
  return fits;
}

SatelliteFit fit_to_satellites(const std::vector<StampedPose>& trajectory,
                               const std::vector<GnssFix>& fixes, SatelliteMethod method,
                               const SatelliteFitConfig& config,
                               const std::vector<SmoothedPose>& smoothed) {
  return fits_to_satellites(trajectory, fixes, {method}, config, smoothed).front();
}

}  // namespace understory
