#include "understory/features/ground_guess.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/features/features_constants.h"
#include "understory/geometry/symmetric_solver.h"

namespace understory {
namespace {

using namespace features_constants::ground_guess;

std::int64_t key(int column, int row) {
  return (static_cast<std::int64_t>(column) << 32) ^
         static_cast<std::int64_t>(static_cast<std::uint32_t>(row));
}

int cell(double value) {
  return static_cast<int>(std::floor(value / kCell));
}

}  // namespace

GroundGuess::GroundGuess(const std::vector<Eigen::Vector3f>& points) {
  if (points.empty()) return;
  // A few strays far away must not make the grid huge.
  constexpr float kFarthest = 300.0F;
  Eigen::Vector2f low = Eigen::Vector2f::Constant(kFarthest);
  Eigen::Vector2f high = -low;
  for (const Eigen::Vector3f& point : points) {
    low = low.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  low = low.cwiseMax(-kFarthest);
  high = high.cwiseMin(kFarthest);
  column0_ = cell(static_cast<double>(low.x()));
  row0_ = cell(static_cast<double>(low.y()));
  columns_ = std::max(0, cell(static_cast<double>(high.x())) - column0_ + 1);
  rows_ = std::max(0, cell(static_cast<double>(high.y())) - row0_ + 1);
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  lowest_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_),
                 Eigen::Vector3f::Constant(kNone));
  for (const Eigen::Vector3f& point : points) {
    const int column = cell(static_cast<double>(point.x())) - column0_;
    const int row = cell(static_cast<double>(point.y())) - row0_;
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) continue;
    Eigen::Vector3f& lowest = lowest_[static_cast<std::size_t>(row * columns_ + column)];
    if (!(lowest.z() <= point.z())) lowest = point;
  }
}

std::optional<GroundGuess::Height> GroundGuess::at(const Eigen::Vector2d& place) {
  const auto column = static_cast<int>(std::floor(place.x() / kPatch));
  const auto row = static_cast<int>(std::floor(place.y() / kPatch));
  const Eigen::Vector2d middle = kPatch * Eigen::Vector2d(column + 0.5, row + 0.5);
  const auto [found, is_new] = planes_.try_emplace(key(column, row));
  if (is_new) found->second = fit(middle);
  if (!found->second.known) return std::nullopt;
  const Eigen::Vector2d off = place - middle;
  const Eigen::Vector3d here(1.0, off.x(), off.y());
  const double fit = std::sqrt(std::max(0.0, here.dot(found->second.covariance * here)));
  return Height{here.dot(found->second.height_and_slope),
                std::clamp(kLeastSd + kGrowth * (fit - kFitSd), kLeastSd, kMostSd)};
}

std::vector<GroundGuess::Low> GroundGuess::lows_near(const Eigen::Vector2d& middle) const {
  std::vector<Low> near;
  near.reserve(static_cast<std::size_t>((2 * kReach + 1) * (2 * kReach + 1)));
  const int middle_column = cell(middle.x()) - column0_;
  const int middle_row = cell(middle.y()) - row0_;
  for (int row = std::max(0, middle_row - kReach); row <= std::min(rows_ - 1, middle_row + kReach);
       ++row) {
    for (int column = std::max(0, middle_column - kReach);
         column <= std::min(columns_ - 1, middle_column + kReach); ++column) {
      const Eigen::Vector3f& point = lowest_[static_cast<std::size_t>(row * columns_ + column)];
      if (std::isnan(point.z())) continue;
      Low low{static_cast<double>(point.x()) - middle.x(),
              static_cast<double>(point.y()) - middle.y(), static_cast<double>(point.z()), 0.0};
      low.sharpness = 1.0 / (kRelief + kReliefGrowth * std::sqrt(low.x * low.x + low.y * low.y));
      near.push_back(low);
    }
  }
  return near;
}

// A plane that what stands on the ground does not lift: what lies above it counts ever less.
GroundGuess::Plane GroundGuess::fit(const Eigen::Vector2d& middle) const {
  const std::vector<Low> near = lows_near(middle);
  if (near.size() < 3) return {};
  double lowest = std::numeric_limits<double>::max();
  for (const Low& low : near)
    lowest = std::min(lowest, low.z);
  Plane plane;
  plane.known = true;
  plane.height_and_slope.x() = lowest;
  for (int round = 0; round < 4; ++round) {
    const Eigen::Vector3d p = plane.height_and_slope;
    double n = 0.0, sx = 0.0, sy = 0.0, sz = 0.0;
    double xx = 0.0, xy = 0.0, yy = 0.0, xz = 0.0, yz = 0.0;
    double squares = 0.0;
    double weights = 0.0;
    for (const Low& low : near) {
      const double ratio = (low.z - p.x() - p.y() * low.x - p.z() * low.y) * low.sharpness;
      double trust = ratio > 0.0 ? 1.0 / (1.0 + ratio * ratio) : 1.0;
      trust *= trust;
      squares += trust * ratio * ratio;
      weights += trust;
      const double weight = trust * low.sharpness * low.sharpness;
      const double wx = weight * low.x;
      const double wy = weight * low.y;
      n += weight;
      sx += wx;
      sy += wy;
      sz += weight * low.z;
      xx += wx * low.x;
      xy += wx * low.y;
      yy += wy * low.y;
      xz += wx * low.z;
      yz += wy * low.z;
    }
    constexpr double kSlopeKnown = 1.0 / (kSlopeSd * kSlopeSd);
    Eigen::Matrix3d information;
    information << n, sx, sy, sx, xx + kSlopeKnown, xy, sy, xy, yy + kSlopeKnown;
    const SymmetricSolver<3> solved(information);
    plane.height_and_slope = solved.solve(Eigen::Vector3d(sz, xz, yz));
    if (round < 3) continue;
    plane.covariance = std::max(1.0, squares / std::max(weights, 1e-9)) * solved.inverse();
  }
  return plane;
}

}  // namespace understory
