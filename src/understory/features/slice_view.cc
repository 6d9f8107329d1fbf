#include "understory/features/slice_view.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/util/median.h"

namespace understory {
namespace {

constexpr double kSlice = 0.25;  // thickness of a level, metres
constexpr double kWidest = 1.0;  // of a section
constexpr double kBeside = 0.3;  // what stands that near belongs to the same thicket
constexpr int kFewest = 4;       // points of a section
constexpr std::size_t kMostLevels = 4000;

// The circle through points by algebraic least squares about their mean, and the root mean square
// of their distances from it; a radius of 0 where they lie on one line.
struct FittedCircle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
  double rms_m = 0.0;
};

FittedCircle fit_circle(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points)
    mean += point;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d off = point - mean;
    const Eigen::Vector3d row(off.x(), off.y(), 1.0);
    normal += row * row.transpose();
    right += off.squaredNorm() * row;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  const Eigen::Vector3d d = solver.vectorD().cwiseAbs();
  FittedCircle circle;
  if (!(d.minCoeff() > 1e-9 * d.maxCoeff())) return circle;
  const Eigen::Vector3d solution = solver.solve(right);
  const Eigen::Vector2d centre = 0.5 * solution.head<2>();
  circle.radius_m = std::sqrt(std::max(0.0, solution.z() + centre.squaredNorm()));
  double squares = 0.0;
  for (const Eigen::Vector2d& point : points)
    squares += std::pow((point - mean - centre).norm() - circle.radius_m, 2);
  circle.rms_m = std::sqrt(squares / static_cast<double>(points.size()));
  circle.centre = mean + centre;
  return circle;
}

}  // namespace

SliceView::SliceView(const Points& points) {
  if (points.size() < 16) return;
  std::vector<float> heights;
  heights.reserve(points.size());
  for (const Eigen::Vector3f& point : points)
    heights.push_back(point.z());
  const auto [low, high] = std::minmax_element(heights.begin(), heights.end());
  low_m_ = static_cast<double>(*low);
  const double levels = std::floor((static_cast<double>(*high) - low_m_) / kSlice) + 1.0;
  const auto count = static_cast<std::size_t>(std::min(levels, static_cast<double>(kMostLevels)));
  calibrate(points);
  cells_.resize(count);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double above = static_cast<double>(points[i].z()) - low_m_;
    const auto level = std::min(static_cast<std::size_t>(above / kSlice), count - 1);
    cells_[level][key(static_cast<double>(points[i].x()), static_cast<double>(points[i].y()))]
        .push_back(static_cast<std::uint32_t>(i));
  }
  for (int level = 0; level < this->levels(); ++level)
    gather(level, points);
}

std::int64_t SliceView::key(double x, double y) const {
  const auto column = static_cast<std::int64_t>(std::floor(x / cell_m_));
  const auto row = static_cast<std::int64_t>(std::floor(y / cell_m_));
  return (column << 32) ^ (row & 0xffffffff);
}

// The median distance of a point to its nearest neighbour in the plane, among the points that share
// a column of 0.25 m and a slice with it.
void SliceView::calibrate(const Points& points) {
  constexpr double kColumn = 0.25;
  std::unordered_map<std::int64_t, std::vector<std::uint32_t>> columns;
  const auto cell = [](double value, double size) {
    return static_cast<std::int64_t>(std::floor(value / size)) & 0x1fffff;
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points[i].cast<double>();
    columns[(cell(p.x(), kColumn) << 42) ^ (cell(p.y(), kColumn) << 21) ^ cell(p.z(), kSlice)]
        .push_back(static_cast<std::uint32_t>(i));
  }
  // In the order of the points, so that the same cloud gives the same answer.
  constexpr std::size_t kMost = 4000;
  const std::size_t step = std::max<std::size_t>(1, points.size() / kMost);
  std::vector<double> nearest;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3d p = points[i].cast<double>();
    double least = kColumn * kColumn;
    for (const std::uint32_t other : columns[(cell(p.x(), kColumn) << 42) ^
                                             (cell(p.y(), kColumn) << 21) ^ cell(p.z(), kSlice)]) {
      if (other == i) continue;
      const double off = (points[other] - points[i]).head<2>().cast<double>().squaredNorm();
      if (off > 0.0) least = std::min(least, off);
    }
    nearest.push_back(std::sqrt(least));
  }
  spacing_m_ = std::clamp(upper_median(nearest), 0.005, 0.05);
  cell_m_ = std::clamp(3.0 * spacing_m_, 0.03, 0.12);
}

// What hangs together over neighbouring cells, by increasing index of its first point.
void SliceView::gather(int level, const Points& points) {
  const Cells& cells = cells_[static_cast<std::size_t>(level)];
  std::vector<std::pair<std::uint32_t, std::int64_t>> order;
  order.reserve(cells.size());
  for (const auto& [at, members] : cells)
    order.emplace_back(members.front(), at);
  std::sort(order.begin(), order.end());
  std::unordered_map<std::int64_t, char> taken;
  std::vector<std::int64_t> open;
  std::vector<std::uint32_t> members;
  for (const auto& [first, start] : order) {
    if (taken.count(start) > 0) continue;
    members.clear();
    open = {start};
    taken[start] = 1;
    while (!open.empty()) {
      const std::int64_t at = open.back();
      open.pop_back();
      const std::vector<std::uint32_t>& here = cells.at(at);
      members.insert(members.end(), here.begin(), here.end());
      const std::int64_t column = at >> 32;
      const auto row = static_cast<std::int64_t>(static_cast<std::int32_t>(at & 0xffffffff));
      for (std::int64_t dx = -1; dx <= 1; ++dx) {
        for (std::int64_t dy = -1; dy <= 1; ++dy) {
          const std::int64_t next = ((column + dx) << 32) ^ ((row + dy) & 0xffffffff);
          if (cells.count(next) == 0 || !taken.try_emplace(next, 1).second) continue;
          open.push_back(next);
        }
      }
    }
    std::sort(members.begin(), members.end());
    add_section(level, points, members, cells);
  }
}

Side SliceView::neighbourhood(const Cells& cells, const Eigen::Vector2d& centre, double from_m,
                              double to_m) const {
  int occupied = 0;
  const int reach = static_cast<int>(std::ceil(to_m / cell_m_));
  for (int i = -reach; i <= reach; ++i) {
    for (int j = -reach; j <= reach; ++j) {
      const Eigen::Vector2d off = cell_m_ * Eigen::Vector2d(i, j);
      if (off.norm() < from_m || off.norm() > to_m) continue;
      occupied += cells.count(key(centre.x() + off.x(), centre.y() + off.y())) > 0 ? 1 : 0;
    }
  }
  return occupied >= 2 ? Side::kRough : Side::kOpen;
}

void SliceView::add_section(int level, const Points& points,
                            const std::vector<std::uint32_t>& members, const Cells& cells) {
  if (members.size() < kFewest) return;
  std::vector<Eigen::Vector2d> places;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9);
  Eigen::Vector2d high = -low;
  double height = 0.0;
  for (const std::uint32_t i : members) {
    places.emplace_back(points[i].head<2>().cast<double>());
    low = low.cwiseMin(places.back());
    high = high.cwiseMax(places.back());
    height += static_cast<double>(points[i].z());
    if ((high - low).maxCoeff() > kWidest) return;
  }
  const double width = (high - low).maxCoeff();
  StemSection section;
  section.surface = 0.5 * (low + high);
  section.width_m = std::max(width, spacing_m_);
  const FittedCircle circle = fit_circle(places);
  if (circle.radius_m > 0.3 * width && circle.radius_m < 0.9 * width + 0.02 &&
      circle.rms_m < 0.25 * circle.radius_m + 0.01) {
    section.surface = circle.centre;
    section.width_m = 2.0 * circle.radius_m;
  }
  section.height_m = height / static_cast<double>(members.size());
  section.spacing_m = spacing_m_;
  section.returns = std::max(1, std::min(static_cast<int>(members.size()),
                                         static_cast<int>(section.width_m / spacing_m_)));
  section.level = level;
  section.left = section.right =
      neighbourhood(cells, section.surface, 0.5 * section.width_m + 2.0 * cell_m_,
                    0.5 * section.width_m + kBeside);
  sections_.push_back(section);
}

double SliceView::height_at(int level, const Eigen::Vector2d& /*place*/) const {
  return low_m_ + (level + 0.5) * kSlice;
}

Sight SliceView::look(int level, const Eigen::Vector2d& place, double half_width_m) const {
  const Cells& cells = cells_[static_cast<std::size_t>(level)];
  const auto occupied = [&](double reach_m) {
    const int reach = static_cast<int>(std::ceil(reach_m / cell_m_));
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        if (cells.count(key(place.x() + i * cell_m_, place.y() + j * cell_m_)) > 0) return true;
      }
    }
    return false;
  };
  if (occupied(half_width_m + cell_m_)) return Sight::kHit;
  return occupied(0.5) ? Sight::kPassed : Sight::kUnknown;
}

}  // namespace understory
