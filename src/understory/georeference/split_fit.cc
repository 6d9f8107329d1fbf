#include "understory/georeference/split_fit.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "understory/georeference/georeference_constants.h"
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

class Splitter {
 public:
  Splitter(const std::vector<SatellitePair>& pairs, const SplitFitConfig& config)
      : pairs_(pairs), config_(config) {
    fit_.height_known =
        std::all_of(pairs.begin(), pairs.end(), [](const auto& p) { return p.has_height; });
    level_ = first_motion(pairs, config.robust, fit_.height_known);
  }

  SplitFit solve() {
    for (int step = 0; step < kSteps; ++step) {
      fit_.enu_from_world = about(middle(), tilt_, Vector3d(0.0, 0.0, up_)) * level_;
      weigh();
      solve_height();
      solve_plane();
    }
    fit_.middle = middle();
    fit_.enu_from_world = about(fit_.middle, tilt_, Vector3d(0.0, 0.0, up_)) * level_;
    fit_.found = true;
    return fit_;
  }

 private:
  [[nodiscard]] Vector3d middle() const {
    Vector3d sum = Vector3d::Zero();
    for (const SatellitePair& pair : pairs_)
      sum += level_ * pair.antenna_in_world;
    return sum / static_cast<double>(pairs_.size());
  }

  void weigh() {
    PairTimes times = pair_times(pairs_, fit_.enu_from_world, config_);
    fit_.plane_times = std::move(times.plane);
    fit_.height_times = std::move(times.height);
    fit_.far_off = std::move(times.far_off);
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
    const NoisyEstimate found =
        estimate_under_noise(fit_.plane_times, series, information, config_.plane);
    level_ = about(centre, Vector3d(0.0, 0.0, found.mean(0)),
                   Vector3d(found.mean(1), found.mean(2), 0.0)) *
             level_;
    if (clock) {
      fit_.time_offset_s += found.mean(3);
      fit_.time_offset_sd_s = std::sqrt(found.covariance(3, 3));
    }
    fit_.plane_noise = found.noise;
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
    const NoisyEstimate found =
        estimate_under_noise(fit_.height_times, {series}, information, config_.height);
    tilt_ = Vector3d(found.mean(0), found.mean(1), 0.0);
    up_ = found.mean(2);
    fit_.height_noise = found.noise;
    const int at[] = {0, 1, 5};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        fit_.spread(at[i], at[j]) = found.covariance(i, j);
    }
  }

  const std::vector<SatellitePair>& pairs_;
  const SplitFitConfig& config_;
  Pose level_;  // without the tilt and the height that were found
  Vector3d tilt_ = Vector3d::Zero();
  double up_ = 0.0;
  SplitFit fit_;
};

Pose at(const Vector3d& middle) {
  return {Eigen::Quaterniond::Identity(), middle};
}

}  // namespace

PairTimes pair_times(const std::vector<SatellitePair>& pairs, const Pose& enu_from_world,
                     const SplitFitConfig& config) {
  PairTimes times;
  times.plane = stated(pairs, true, config.most_scale);
  times.height = stated(pairs, false, config.most_scale);
  times.far_off.assign(pairs.size(), 0);
  if (!config.robust) return times;
  std::vector<double> plane;
  std::vector<double> up;
  for (const SatellitePair& pair : pairs) {
    const Vector3d r = pair.fix_in_enu - enu_from_world * pair.antenna_in_world;
    plane.push_back(r.head<2>().norm());
    up.push_back(std::abs(r.z()));
  }
  const double plane_sd = std::max(1e-6, upper_median(plane) / kRayleighMedian);
  const double up_sd = std::max(1e-6, upper_median(up) / kNormalMedian);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    times.far_off[k] = plane[k] > kFarOff * plane_sd ? 1 : 0;
    if (times.far_off[k] != 0) times.plane.extra_sd_m(row) = plane[k];
    if (up[k] > kFarOff * up_sd) times.height.extra_sd_m(row) = up[k];
  }
  return times;
}

SplitFit fit_split(const std::vector<SatellitePair>& pairs, const SplitFitConfig& config) {
  SplitFit fit;
  if (pairs.size() < kFewestPairs) {
    fit.reason =
        fmt::format("expected fixes of three seconds at least at times of the path: there are {}",
                    pairs.size());
    return fit;
  }
  const double extent_m = plane_extent_m(pairs);
  if (extent_m < kLeastExtentM) {
    fit.reason = fmt::format(
        "the path spans {:.1f} m while there are fixes: expected {:.0f} m at least, to tell the "
        "heading",
        extent_m, kLeastExtentM);
    return fit;
  }
  return Splitter(pairs, config).solve();
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
