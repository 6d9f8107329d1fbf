#include "understory/georeference/terrain_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::terrain_fit;

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kFixed = 1e-9;  // standard deviation of what is kept

// A point with terrain below it, moved by the motion so far.
struct Sample {
  Vector3d arm;    // from the pivot
  double above_m;  // its height above the terrain
  Vector2d slope;  // of the terrain there
  double sd_m;
};

// Slope of the bilinear surface over a cell's length.
Vector2d slope_of(const Raster& terrain, double x, double y) {
  const double h = 0.5 * terrain.cell_m;
  const Vector2d slope(terrain.interpolate(x + h, y) - terrain.interpolate(x - h, y),
                       terrain.interpolate(x, y + h) - terrain.interpolate(x, y - h));
  return slope.allFinite() ? Vector2d(slope / (2.0 * h)) : Vector2d::Zero();
}

std::vector<Sample> samples_of(const std::vector<GroundPoint>& points, const Raster& terrain,
                               const Pose& motion, const Vector3d& pivot) {
  std::vector<Sample> samples;
  for (const GroundPoint& point : points) {
    const Vector3d at = motion * point.point_in_world;
    const double ground = terrain.interpolate(at.x(), at.y());
    if (!std::isfinite(ground)) continue;
    samples.push_back({at - pivot, at.z() - ground, slope_of(terrain, at.x(), at.y()), point.sd_m});
  }
  return samples;
}

// Standard deviation of the heights from the median of those that can be trusted.
double spread_of(const std::vector<Sample>& samples, double centre) {
  std::vector<double> absolute;
  for (const Sample& sample : samples)
    absolute.push_back(std::abs(sample.above_m - centre));
  return std::max(kLeastTerrainWidthM, kSdOverMad * upper_median(std::move(absolute)));
}

double centre_of(const std::vector<Sample>& samples) {
  std::vector<double> heights;
  for (const Sample& sample : samples)
    heights.push_back(sample.above_m);
  return upper_median(std::move(heights));
}

double biweight(double above_m, double width_m) {
  const double u = above_m / width_m;
  return std::abs(u) < 1.0 ? std::pow(1.0 - u * u, 2.0) : 0.0;
}

// How the height above the terrain changes with a small motion about the pivot (rotation,
// translation; in the world's axes).
Vector6d gradient_of(const Sample& sample) {
  const Vector3d normal(-sample.slope.x(), -sample.slope.y(), 1.0);
  Vector6d gradient;
  gradient << sample.arm.cross(normal), normal;
  return gradient;
}

// What is known of the motion from the start, about the pivot: rotation, translation.
Matrix6d prior_information(const TerrainFitConfig& config, const Vector3d& pivot) {
  if (config.known)
    return information_about(config.known->information, config.known->middle, pivot);
  constexpr double kFree = 1e6;
  const double yaw = std::max(kFixed, config.yaw_sd_deg * M_PI / 180.0);
  const double place = std::max(kFixed, config.place_sd_m);
  Vector6d sd;
  sd << kFree, kFree, yaw, place, place, kFree;
  return sd.cwiseAbs2().cwiseInverse().asDiagonal();
}

struct Solution {
  Vector6d step = Vector6d::Zero();
  Matrix6d covariance = Matrix6d::Zero();
};

// One step of weighted least squares; `gone` is the motion so far, `alike` how many points count
// as one.
Solution solve(const std::vector<Sample>& samples, double centre, double spread, double alike,
               const Vector6d& gone, const Matrix6d& prior) {
  Matrix6d information = prior;
  Vector6d right = -prior * gone;
  for (const Sample& sample : samples) {
    const double variance = spread * spread + sample.sd_m * sample.sd_m;
    const double weight =
        biweight(sample.above_m - centre, kBiweightReach * std::sqrt(variance)) / variance / alike;
    const Vector6d gradient = gradient_of(sample);
    information += weight * gradient * gradient.transpose();
    right -= weight * sample.above_m * gradient;
  }
  const SymmetricSolver<6> factor(information);
  return {factor.solve(right), factor.inverse()};
}

// How many points share a patch of the ground in the mean.
double alike(const std::vector<Sample>& samples, double correlation_m) {
  std::set<std::pair<long, long>> patches;
  for (const Sample& sample : samples)
    patches.emplace(std::lround(sample.arm.x() / correlation_m),
                    std::lround(sample.arm.y() / correlation_m));
  return static_cast<double>(samples.size()) / static_cast<double>(patches.size());
}

// Whether the points spread over an area, so that they fix a tilt.
bool spread_out(const std::vector<Sample>& samples) {
  Vector2d mean = Vector2d::Zero();
  for (const Sample& sample : samples)
    mean += sample.arm.head<2>() / static_cast<double>(samples.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Sample& sample : samples) {
    const Vector2d d = sample.arm.head<2>() - mean;
    scatter += d * d.transpose() / static_cast<double>(samples.size());
  }
  return symmetric_eigen(scatter).values[0] > 1.0;
}

void tell(const std::vector<Sample>& before, const std::vector<Sample>& after, TerrainFit& fit) {
  const auto n = static_cast<double>(before.size());
  for (const Sample& sample : before)
    fit.mean_before_m += sample.above_m / n;
  for (const Sample& sample : before)
    fit.rms_before_m += std::pow(sample.above_m - fit.mean_before_m, 2.0) / n;
  fit.rms_before_m = std::sqrt(fit.rms_before_m);
  const double spread = spread_of(after, 0.0);
  std::vector<double> absolute;
  for (const Sample& sample : after) {
    fit.rms_m += sample.above_m * sample.above_m / static_cast<double>(after.size());
    absolute.push_back(std::abs(sample.above_m));
    const double width = kBiweightReach * std::hypot(spread, sample.sd_m);
    fit.used += biweight(sample.above_m, width) > 0.0 ? 1 : 0;
  }
  fit.rms_m = std::sqrt(fit.rms_m);
  fit.median_m = upper_median(std::move(absolute));
  fit.points = after.size();
}

Vector3d pivot_of(const std::vector<GroundPoint>& points) {
  Vector3d pivot = Vector3d::Zero();
  for (const GroundPoint& point : points)
    pivot += point.point_in_world / static_cast<double>(points.size());
  return pivot;
}

}  // namespace

TerrainFit fit_to_terrain(const std::vector<GroundPoint>& points, const Raster& terrain,
                          const TerrainFitConfig& config) {
  TerrainFit fit;
  const Vector3d pivot = points.empty() ? Vector3d(Vector3d::Zero()) : pivot_of(points);
  const std::vector<Sample> before = samples_of(points, terrain, Pose(), pivot);
  if (before.size() < kLeastPoints || !spread_out(before)) {
    fit.reason = fmt::format(
        "{} of {} points on the ground lie on the terrain model: expected {} or more that do not "
        "lie on one line",
        before.size(), points.size(), kLeastPoints);
    return fit;
  }
  // A motion about the pivot: rotation after rotation, shifts add up.
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vector3d shift = Vector3d::Zero();
  const auto motion = [&] { return Pose(rotation, pivot + shift - rotation * pivot); };
  const Matrix6d prior = prior_information(config, pivot);
  Solution solution;
  constexpr int kSteps = 60;
  for (int step = 0; step < kSteps; ++step) {
    const std::vector<Sample> now = samples_of(points, terrain, motion(), pivot + shift);
    if (now.size() < kLeastPoints) {
      fit.reason = "the fit left the terrain model";
      return fit;
    }
    // At first the height may be far off altogether.
    const double centre = step == 0 ? centre_of(now) : 0.0;
    Vector6d gone;
    gone << so3_log(rotation), shift;
    solution =
        solve(now, centre, spread_of(now, centre), alike(now, config.correlation_m), gone, prior);
    rotation = so3_exp(solution.step.head<3>()) * rotation;
    shift += solution.step.tail<3>();
    if (solution.step.norm() < 1e-9) break;
  }
  fit.found = true;
  fit.terrain_from_world = motion();
  tell(before, samples_of(points, terrain, motion(), pivot + shift), fit);
  fit.tilt_deg =
      std::acos(std::clamp((rotation * Vector3d::UnitZ()).z(), -1.0, 1.0)) * 180.0 / M_PI;
  fit.middle = pivot + shift;
  fit.spread = solution.covariance;
  fit.place_sd_m = std::sqrt(solution.covariance.block<2, 2>(3, 3).trace());
  fit.yaw_sd_deg = std::sqrt(solution.covariance(2, 2)) * 180.0 / M_PI;
  return fit;
}

}  // namespace understory
