#include "understory/features/ground_guess.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace understory {
namespace {

constexpr double kCell = 1.5;      // with one lowest return
constexpr double kPatch = 3.0;     // with one plane
constexpr int kReach = 4;          // cells to each side of a patch's middle
constexpr double kSlopeSd = 0.15;  // of the ground
constexpr double kRelief = 0.08;   // metres, of the lowest returns about a plane

std::int64_t key(int column, int row) {
  return (static_cast<std::int64_t>(column) << 32) ^
         static_cast<std::int64_t>(static_cast<std::uint32_t>(row));
}

int cell(double value) {
  return static_cast<int>(std::floor(value / kCell));
}

}  // namespace

GroundGuess::GroundGuess(const std::vector<Eigen::Vector3f>& points) {
  for (const Eigen::Vector3f& point : points) {
    const auto [at, is_new] = lowest_.try_emplace(
        key(cell(static_cast<double>(point.x())), cell(static_cast<double>(point.y()))), point);
    if (!is_new && point.z() < at->second.z()) at->second = point;
  }
}

std::optional<double> GroundGuess::at(const Eigen::Vector2d& place) {
  const auto column = static_cast<int>(std::floor(place.x() / kPatch));
  const auto row = static_cast<int>(std::floor(place.y() / kPatch));
  const Eigen::Vector2d middle = kPatch * Eigen::Vector2d(column + 0.5, row + 0.5);
  const auto [found, is_new] = planes_.try_emplace(key(column, row));
  if (is_new) found->second = fit(middle);
  if (!found->second.known) return std::nullopt;
  const Eigen::Vector2d off = place - middle;
  return found->second.height_and_slope.dot(Eigen::Vector3d(1.0, off.x(), off.y()));
}

// A plane that what stands on the ground does not lift: what lies above it counts ever less.
GroundGuess::Plane GroundGuess::fit(const Eigen::Vector2d& middle) const {
  std::vector<Eigen::Vector3d> near;
  for (int row = -kReach; row <= kReach; ++row) {
    for (int column = -kReach; column <= kReach; ++column) {
      const auto found = lowest_.find(key(cell(middle.x()) + column, cell(middle.y()) + row));
      if (found == lowest_.end()) continue;
      near.emplace_back(found->second.cast<double>());
      near.back().head<2>() -= middle;
    }
  }
  if (near.size() < 3) return {};
  Plane plane{true, Eigen::Vector3d::Zero()};
  plane.height_and_slope.x() =
      std::min_element(near.begin(), near.end(), [](const auto& a, const auto& b) {
        return a.z() < b.z();
      })->z();
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    information(1, 1) = information(2, 2) = 1.0 / (kSlopeSd * kSlopeSd);
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& low : near) {
      const Eigen::Vector3d row(1.0, low.x(), low.y());
      const double spread = kRelief + 0.05 * low.head<2>().norm();
      const double ratio = (low.z() - row.dot(plane.height_and_slope)) / spread;
      double weight = 1.0 / (spread * spread);
      if (ratio > 0.0) weight /= (1.0 + ratio * ratio) * (1.0 + ratio * ratio);
      information += weight * row * row.transpose();
      right += weight * low.z() * row;
    }
    plane.height_and_slope = information.ldlt().solve(right);
  }
  return plane;
}

}  // namespace understory
