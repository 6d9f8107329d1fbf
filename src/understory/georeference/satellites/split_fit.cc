#include "understory/georeference/satellites/split_fit.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::split_fit;

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

Pose about(const Vector3d& middle, const Vector3d& turn, const Vector3d& shift) {
  const Pose to(Eigen::Quaterniond::Identity(), middle);
  return to * Pose(so3_exp(turn), shift) * to.inverse();
}

// Turn about up and shift in the plane, least squares with Cauchy's weights, and the height by the
// median.
Pose first_motion(const std::vector<SatellitePair>& pairs, bool robust, bool heights) {
  std::vector<double> weight(pairs.size(), 1.0);
  Eigen::Rotation2Dd turn(0.0);
  Vector2d shift = Vector2d::Zero();
  for (int step = 0; step < (robust ? kFirstSteps : 1); ++step) {
    Vector2d source = Vector2d::Zero();
    Vector2d target = Vector2d::Zero();
    double total = 0.0;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      source += weight[k] * pairs[k].antenna_in_world.head<2>();
      target += weight[k] * pairs[k].fix_in_enu.head<2>();
      total += weight[k];
    }
    source /= total;
    target /= total;
    double along = 0.0;
    double across = 0.0;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const Vector2d s = pairs[k].antenna_in_world.head<2>() - source;
      const Vector2d t = pairs[k].fix_in_enu.head<2>() - target;
      along += weight[k] * s.dot(t);
      across += weight[k] * (s.x() * t.y() - s.y() * t.x());
    }
    turn = Eigen::Rotation2Dd(std::atan2(across, along));
    shift = target - turn * source;
    std::vector<double> off;
    for (const SatellitePair& pair : pairs)
      off.push_back(
          (pair.fix_in_enu.head<2>() - turn * pair.antenna_in_world.head<2>() - shift).norm());
    const double width = kCauchyWidth * std::max(1e-6, upper_median(off) / kRayleighMedian);
    for (std::size_t k = 0; k < pairs.size(); ++k)
      weight[k] = 1.0 / (1.0 + std::pow(off[k] / width, 2.0));
  }
  std::vector<double> up;
  for (const SatellitePair& pair : pairs)
    up.push_back(pair.fix_in_enu.z() - pair.antenna_in_world.z());
  return {Eigen::Quaterniond(Eigen::AngleAxisd(turn.angle(), Vector3d::UnitZ())),
          Vector3d(shift.x(), shift.y(), heights ? upper_median(up) : 0.0)};
}

// What the receiver states of each pair, over the median of all.
NoisyTimes stated(const std::vector<SatellitePair>& pairs, bool plane, double most_scale) {
  NoisyTimes times;
  std::vector<double> sd;
  for (const SatellitePair& pair : pairs) {
    times.time_s.push_back(pair.time_s);
    sd.push_back(std::sqrt(plane ? 0.5 * pair.covariance.topLeftCorner<2, 2>().trace()
                                 : pair.covariance(2, 2)));
  }
  times.stated_sd_m = upper_median(sd);
  times.scale = VectorXd::Ones(static_cast<Eigen::Index>(sd.size()));
  times.extra_sd_m = VectorXd::Zero(times.scale.size());
  for (std::size_t k = 0; k < sd.size(); ++k)
    times.scale(static_cast<Eigen::Index>(k)) =
        std::clamp(sd[k] / times.stated_sd_m, 1.0 / most_scale, most_scale);
  return times;
}

// The residual of each pair that lies far off the others, both as it is and over what the receiver
// states. 0 for the others.
VectorXd far_off_m(const VectorXd& off_m, const VectorXd& scale, double median) {
  const VectorXd relative = off_m.cwiseQuotient(scale);
  const auto sd_of = [&](const VectorXd& all) {
    return std::max(1e-6, upper_median(std::vector<double>(all.begin(), all.end())) / median);
  };
  const double sd_m = sd_of(off_m);
  const double relative_sd = sd_of(relative);
  VectorXd extra = VectorXd::Zero(scale.size());
  for (Eigen::Index k = 0; k < extra.size(); ++k) {
    if (off_m(k) > kFarOff * sd_m && relative(k) > kFarOff * relative_sd) extra(k) = off_m(k);
  }
  return extra;
}

class Splitter {
 public:
  Splitter(const std::vector<SatellitePair>& pairs, const SplitFitConfig& config,
           std::optional<TurnByHeadings> headings)
      : pairs_(pairs), config_(config), headings_(headings) {
    fit_.height_known =
        std::all_of(pairs.begin(), pairs.end(), [](const auto& p) { return p.has_height; });
    level_ = first_motion(pairs, config.robust, fit_.height_known);
    if (headings_)  // positions of one place may turn it any way
      level_ = about(middle(), Vector3d(0.0, 0.0, turn_to_headings()), Vector3d::Zero()) * level_;
  }

  SplitFit solve() {
    for (int step = 0; step < kSteps; ++step) {
      fit_.enu_from_world = about(middle(), tilt_, Vector3d(0.0, 0.0, up_)) * level_;
      if (step == 0)
        weigh_at_first();
      else
        weigh_again();
      // The noise of the last step counts; those before tell what lies far off.
      height_search_.integrate = plane_search_.integrate = step + 1 == kSteps;
      solve_height();
      solve_plane();
    }
    fit_.middle = middle();
    fit_.enu_from_world = about(fit_.middle, tilt_, Vector3d(0.0, 0.0, up_)) * level_;
    for (Eigen::Index k = 0; k < fit_.plane_times.extra_sd_m.size(); ++k)
      fit_.far_off.push_back(fit_.plane_times.extra_sd_m(k) > 0.0 ? 1 : 0);
    fit_.found = true;
    return fit_;
  }

 private:
  // From the turn of `level_` to that of the headings, rad.
  [[nodiscard]] double turn_to_headings() const {
    return std::remainder(headings_->turn_rad - yaw_of(level_), 2.0 * M_PI);
  }

  [[nodiscard]] Vector3d middle() const {
    Vector3d sum = Vector3d::Zero();
    for (const SatellitePair& pair : pairs_)
      sum += level_ * pair.antenna_in_world;
    return sum / static_cast<double>(pairs_.size());
  }

  // What lies far off, at first by its residual alone.
  void weigh_at_first() {
    fit_.plane_times = stated(pairs_, true, config_.most_scale);
    fit_.height_times = stated(pairs_, false, config_.most_scale);
    if (config_.robust) {
      const Eigen::Matrix3Xd off = residuals();
      fit_.plane_times.extra_sd_m =
          far_off_m(off.topRows<2>().colwise().norm(), fit_.plane_times.scale, kRayleighMedian);
      fit_.height_times.extra_sd_m =
          far_off_m(off.row(2).cwiseAbs(), fit_.height_times.scale, kNormalMedian);
    }
  }

  // Then beside the slow errors that were found.
  void weigh_again() {
    if (!config_.robust) return;
    const Eigen::Matrix3Xd off = residuals();
    fit_.plane_times.extra_sd_m =
        outliers_m(fit_.plane_times, *plane_search_.near, off.topRows<2>().transpose());
    if (fit_.height_known)
      fit_.height_times.extra_sd_m =
          outliers_m(fit_.height_times, *height_search_.near, off.row(2).transpose());
  }

  [[nodiscard]] Eigen::Matrix3Xd residuals() const {
    Eigen::Matrix3Xd off(3, static_cast<Eigen::Index>(pairs_.size()));
    for (std::size_t k = 0; k < pairs_.size(); ++k)
      off.col(static_cast<Eigen::Index>(k)) =
          pairs_[k].fix_in_enu - fit_.enu_from_world * pairs_[k].antenna_in_world;
    return off;
  }

  void solve_plane() {
    const bool clock = config_.time_offset_sd_s > 0.0;
    const Eigen::Index rows = static_cast<Eigen::Index>(pairs_.size());
    std::vector<NoisySeries> series(
        2, NoisySeries{VectorXd::Zero(rows), MatrixXd::Zero(rows, clock ? 4 : 3)});
    const Vector3d centre = middle();
    for (Eigen::Index k = 0; k < rows; ++k) {
      const SatellitePair& pair = pairs_[static_cast<std::size_t>(k)];
      const Vector3d v = fit_.enu_from_world.rotation() * pair.velocity_in_world;
      const Vector3d q = fit_.enu_from_world * pair.antenna_in_world + fit_.time_offset_s * v;
      const Vector3d d = q - centre;
      series[0].residual(k) = pair.fix_in_enu.x() - q.x();
      series[1].residual(k) = pair.fix_in_enu.y() - q.y();
      series[0].jacobian.row(k).head<3>() << -d.y(), 1.0, 0.0;
      series[1].jacobian.row(k).head<3>() << d.x(), 0.0, 1.0;
      if (!clock) continue;
      series[0].jacobian(k, 3) = v.x();
      series[1].jacobian(k, 3) = v.y();
    }
    MatrixXd information = MatrixXd::Zero(clock ? 4 : 3, clock ? 4 : 3);
    if (clock) information(3, 3) = std::pow(config_.time_offset_sd_s, -2.0);
    // What the headings know of the turn: it is about so much, and the rest is about zero.
    const double known_turn = headings_ ? turn_to_headings() : 0.0;
    if (headings_) {
      information(0, 0) = std::pow(headings_->sd_rad, -2.0);
      for (NoisySeries& axis : series)
        axis.residual -= known_turn * axis.jacobian.col(0);
    }
    NoisyEstimate found =
        estimate_under_noise(fit_.plane_times, series, information, config_.plane, plane_search_);
    found.mean(0) += known_turn;
    level_ = about(centre, Vector3d(0.0, 0.0, found.mean(0)),
                   Vector3d(found.mean(1), found.mean(2), 0.0)) *
             level_;
    if (clock) {
      fit_.time_offset_s += found.mean(3);
      fit_.time_offset_sd_s = std::sqrt(found.covariance(3, 3));
    }
    fit_.plane_noise = found.noise;
    plane_search_.near = found.likeliest;
    fit_.spread.block<3, 3>(2, 2) = found.covariance.topLeftCorner<3, 3>();
  }

  void solve_height() {
    const double tilt_sd = config_.tilt_sd_deg * M_PI / 180.0;
    if (!fit_.height_known) {
      fit_.spread(0, 0) = fit_.spread(1, 1) = tilt_sd * tilt_sd;
      fit_.spread(5, 5) = kUnknownHeightM * kUnknownHeightM;
      return;
    }
    const Eigen::Index rows = static_cast<Eigen::Index>(pairs_.size());
    NoisySeries series{VectorXd::Zero(rows), MatrixXd::Zero(rows, 3)};
    const Vector3d centre = middle();
    for (Eigen::Index k = 0; k < rows; ++k) {
      const SatellitePair& pair = pairs_[static_cast<std::size_t>(k)];
      const Vector3d q = level_ * pair.antenna_in_world;
      const Vector3d d = q - centre;
      series.residual(k) = pair.fix_in_enu.z() - q.z();
      series.jacobian.row(k) << d.y(), -d.x(), 1.0;  // turn about east, about north; up
    }
    MatrixXd information = MatrixXd::Zero(3, 3);
    information(0, 0) = information(1, 1) = 1.0 / std::max(1e-12, tilt_sd * tilt_sd);
    const NoisyEstimate found = estimate_under_noise(fit_.height_times, {series}, information,
                                                     config_.height, height_search_);
    tilt_ = Vector3d(found.mean(0), found.mean(1), 0.0);
    up_ = found.mean(2);
    fit_.height_noise = found.noise;
    height_search_.near = found.likeliest;
    const int at[] = {0, 1, 5};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        fit_.spread(at[i], at[j]) = found.covariance(i, j);
    }
  }

  const std::vector<SatellitePair>& pairs_;
  const SplitFitConfig& config_;
  std::optional<TurnByHeadings> headings_;
  Pose level_;  // without the tilt and the height that were found
  Vector3d tilt_ = Vector3d::Zero();
  double up_ = 0.0;
  NoiseSearch plane_search_;
  NoiseSearch height_search_;
  SplitFit fit_;
};

// With the headings of a second antenna where the positions do not contradict them.
SplitFit fit_with_headings(const std::vector<SatellitePair>& pairs, const SplitFitConfig& config,
                           const TurnByHeadings& turn, bool positions_tell) {
  UsedHeadings headings;
  headings.turn = turn;
  headings.used = true;
  SplitFit fit;
  if (positions_tell) {
    fit = Splitter(pairs, config, std::nullopt).solve();
    const double sd_rad = std::sqrt(fit.spread(2, 2));
    headings.off_rad = std::remainder(turn.turn_rad - yaw_of(fit.enu_from_world), 2.0 * M_PI);
    headings.off_sd_rad = std::hypot(turn.sd_rad, sd_rad);
    headings.used = !contradicts(headings.off_rad, turn.sd_rad, sd_rad, config.second_antenna);
  }
  if (headings.used) fit = Splitter(pairs, config, turn).solve();
  fit.headings = headings;
  return fit;
}

Pose at(const Vector3d& middle) {
  return {Eigen::Quaterniond::Identity(), middle};
}

}  // namespace

double straightness(const std::vector<StampedPose>& path) {
  Vector2d sum = Vector2d::Zero();
  for (const StampedPose& pose : path) {
    const Vector3d heading = pose.world_from_body.rotation() * Vector3d::UnitX();
    sum += heading.head<2>().stableNormalized();
  }
  return path.empty() ? 0.0 : sum.norm() / static_cast<double>(path.size());
}

double tilt_sd_deg(LevelledBy what, double straightness) {
  switch (what) {
    case LevelledBy::kGravity:
      return std::hypot(kLevelSdDeg, kBiasTiltSdDeg * straightness);
    case LevelledBy::kStems:
      return 1.0;
    default:
      return 5.0;
  }
}

SplitFit fit_split(const std::vector<SatellitePair>& pairs, const SplitFitConfig& config) {
  SplitFit fit;
  if (pairs.size() < kFewestPlanePairs) {
    fit.reason =
        fmt::format("expected fixes of three seconds at least at times of the path: there are {}",
                    pairs.size());
    return fit;
  }
  const double extent_m = plane_extent_m(pairs);
  if (const auto turn = turn_by_headings(pairs, config.second_antenna))
    return fit_with_headings(pairs, config, *turn, extent_m >= kLeastExtentM);
  if (extent_m < kLeastExtentM) {
    fit.reason = fmt::format(
        "the path spans {:.1f} m while there are fixes: expected {:.0f} m at least, to tell the "
        "heading",
        extent_m, kLeastExtentM);
    return fit;
  }
  return Splitter(pairs, config, std::nullopt).solve();
}

Matrix6d right_from_spread(const Matrix6d& spread, const Pose& target_from_source,
                           const Vector3d& middle) {
  const Matrix6d a = (target_from_source.inverse() * at(middle)).adjoint();
  return a * spread * a.transpose();
}

Matrix6d spread_from_right(const Matrix6d& covariance, const Pose& target_from_source,
                           const Vector3d& middle) {
  const Matrix6d a = (at(middle).inverse() * target_from_source).adjoint();
  return a * covariance * a.transpose();
}

double expected_error_m(const Matrix6d& spread, const Vector3d& middle,
                        const std::vector<Vector3d>& places) {
  double sum = 0.0;
  for (const Vector3d& place : places) {
    Eigen::Matrix<double, 3, 6> j;
    j << -skew(place - middle), Eigen::Matrix3d::Identity();
    sum += (j * spread * j.transpose()).trace();
  }
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, places.size())));
}

}  // namespace understory
