#include "understory/registration/stems/yaw_vote.h"
#include "understory/registration/registration_constants.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

#include <algorithm>
#include <cmath>

namespace understory {
namespace {

using namespace registration_constants::yaw_vote;

// The votes for one yaw, as a square of cells of shifts around the guess.
struct Ballot {
  double cell_m = 1.0;
  double range_m = 1.0;
  int side = 1;
  std::vector<float> cells;

  void cast(const Eigen::Vector2d& shift) {
    // Shared among the four cells around, so that a true shift on a border is not split.
    const double x = (shift.x() + range_m) / cell_m;
    const double y = (shift.y() + range_m) / cell_m;
    if (!(x >= 0.0 && y >= 0.0 && x < side - 1 && y < side - 1)) return;
    const int ix = static_cast<int>(x);
    const int iy = static_cast<int>(y);
    const auto fx = static_cast<float>(x - ix);
    const auto fy = static_cast<float>(y - iy);
    float* at = &cells[static_cast<std::size_t>(iy * side + ix)];
    at[0] += (1.0F - fx) * (1.0F - fy);
    at[1] += fx * (1.0F - fy);
    at[side] += (1.0F - fx) * fy;
    at[side + 1] += fx * fy;
  }
  [[nodiscard]] Eigen::Vector2d shift_of(std::size_t cell) const {
    return {static_cast<double>(cell % static_cast<std::size_t>(side)) * cell_m - range_m,
            static_cast<double>(cell / static_cast<std::size_t>(side)) * cell_m - range_m};
  }
};

struct Peak {
  double yaw = 0.0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  double votes = 0.0;
};

double mean_radius(const SparsePoints& points) {
  double sum = 0.0;
  for (const Eigen::Vector3d& point : points)
    sum += point.head<2>().norm();
  return sum / static_cast<double>(points.size());
}

// The fullest cell of one yaw. `height` is the tolerance of heights.
Peak vote(const PlaneGrid& grid, const SparsePoints& turned, double yaw, double height,
          Ballot& ballot) {
  std::fill(ballot.cells.begin(), ballot.cells.end(), 0.0F);
  const SparsePoints& target = grid.points();
  for (const Eigen::Vector3d& point : turned) {
    grid.around(point, ballot.range_m, [&](int i) {
      const Eigen::Vector3d d = target[static_cast<std::size_t>(i)] - point;
      if (std::abs(d.z()) <= height) ballot.cast(d.head<2>());
    });
  }
  const auto best = std::max_element(ballot.cells.begin(), ballot.cells.end());
  const auto cell = static_cast<std::size_t>(best - ballot.cells.begin());
  return {yaw, ballot.shift_of(cell), *best};
}

double angle_between(double a, double b) {
  return std::abs(std::remainder(a - b, 2.0 * M_PI));
}

// Pairs that agree with a peak say how far apart the heights are.
double median_height(const PlaneGrid& grid, const SparsePoints& turned, const Peak& peak,
                     double cell_m, double height) {
  std::vector<double> heights;
  const Eigen::Vector3d shift(peak.shift.x(), peak.shift.y(), 0.0);
  for (const Eigen::Vector3d& point : turned) {
    const auto found = grid.nearest(point + shift, cell_m, 0.0);
    if (found.index < 0) continue;
    const double d = grid.points()[static_cast<std::size_t>(found.index)].z() - point.z();
    if (std::abs(d) <= height) heights.push_back(d);
  }
  return upper_median(std::move(heights));
}

SparsePoints turn(const SparsePoints& source, const Pose& guess, double yaw) {
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * guess.rotation_matrix();
  SparsePoints turned;
  turned.reserve(source.size());
  for (const Eigen::Vector3d& point : source)
    turned.emplace_back(rotation * point + guess.translation());
  return turned;
}

}  // namespace

void describe(ConfigTable& table, YawVoteConfig& config) {
  table.add("yaw_range_deg", config.yaw_range_deg, {0.0, 180.0}, "deg",
            "searched heading to each side of the guess");
  table.add("shift_range_m", config.shift_range_m, {0.1, 100.0}, "m",
            "searched shift to each side of the guess, per axis");
  table.add("cell_ratio", config.cell_ratio, {0.01, 1.0}, "stem spacings",
            "side of a cell of shifts");
  table.add("candidates", config.candidates, {1, 100}, "",
            "number of guesses from which ICP starts");
  table.add("height_range_ratio", config.height_range_ratio, {0.01, 100.0}, "stem spacings",
            "largest difference of heights in a pair that votes");
}

std::vector<YawVoteCandidate> vote_yaw(const SparseTarget& target, const SparsePoints& source,
                                       const Pose& guess, const YawVoteConfig& config) {
  if (source.empty() || target.grid.points().empty() || target.l0_m <= 0.0) return {};
  Ballot ballot;
  ballot.cell_m = config.cell_ratio * target.l0_m;
  ballot.range_m = config.shift_range_m + ballot.cell_m;
  ballot.side = static_cast<int>(std::ceil(2.0 * ballot.range_m / ballot.cell_m)) + 2;
  ballot.cells.resize(static_cast<std::size_t>(ballot.side) *
                      static_cast<std::size_t>(ballot.side));
  const double height = config.height_range_ratio * target.l0_m;
  const double step = ballot.cell_m / std::max(mean_radius(source), ballot.cell_m);
  const double range = config.yaw_range_deg * M_PI / 180.0;
  const int steps = static_cast<int>(std::floor(range / step));
  std::vector<Peak> peaks;
  for (int k = -steps; k <= steps; ++k) {
    const double yaw = k * step;
    peaks.push_back(vote(target.grid, turn(source, guess, yaw), yaw, height, ballot));
  }
  sort_stably(peaks, [](const Peak& a, const Peak& b) { return a.votes > b.votes; });
  std::vector<Peak> chosen;
  for (const Peak& peak : peaks) {
    if (static_cast<int>(chosen.size()) >= config.candidates) break;
    const bool known = std::any_of(chosen.begin(), chosen.end(), [&](const Peak& other) {
      return angle_between(peak.yaw, other.yaw) < kSameYawSteps * step &&
             (peak.shift - other.shift).norm() < kSameCells * ballot.cell_m;
    });
    if (!known) chosen.push_back(peak);
  }
  std::vector<YawVoteCandidate> result;
  for (const Peak& peak : chosen) {
    const SparsePoints turned = turn(source, guess, peak.yaw);
    const double z = median_height(target.grid, turned, peak, ballot.cell_m, height);
    // Turned about the source's own origin, then shifted.
    const Eigen::Quaterniond yaw(Eigen::AngleAxisd(peak.yaw, Eigen::Vector3d::UnitZ()));
    result.push_back(
        {Pose(yaw * guess.rotation(),
              guess.translation() + Eigen::Vector3d(peak.shift.x(), peak.shift.y(), z)),
         peak.votes});
  }
  return result;
}

}  // namespace understory
