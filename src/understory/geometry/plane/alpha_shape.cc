#include "understory/geometry/plane/alpha_shape.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <unordered_map>

#include "understory/geometry/plane/delaunay.h"
#include "understory/util/index.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using Eigen::Vector2d;

constexpr double kCornersPerRadius = 25.0;

class Union {
 public:
  explicit Union(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  int root(int i) {
    while (parent_[at(i)] != i)
      i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  // The smaller index stays the root.
  void join(int a, int b) {
    a = root(a);
    b = root(b);
    parent_[at(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<int> parent_;
};

std::int64_t cell_of(const Vector2d& point, double side) {
  const auto x = static_cast<std::int64_t>(std::floor(point.x() / side));
  const auto y = static_cast<std::int64_t>(std::floor(point.y() / side));
  return x * (std::int64_t{1} << 32) + y;
}

// Means of the points in cells of a fine grid, and which of them each point belongs to.
struct Corners {
  std::vector<Vector2d> points;
  std::vector<int> of_point;
  std::vector<int> count;
};

Corners corners_of(const std::vector<Vector2d>& points, double side) {
  Corners corners;
  std::unordered_map<std::int64_t, int> known;
  known.reserve(points.size() / 4);
  corners.of_point.reserve(points.size());
  for (const Vector2d& point : points) {
    const auto [found, added] =
        known.try_emplace(cell_of(point, side), static_cast<int>(corners.points.size()));
    if (added) {
      corners.points.push_back(Vector2d::Zero());
      corners.count.push_back(0);
    }
    corners.points[at(found->second)] += point;
    ++corners.count[at(found->second)];
    corners.of_point.push_back(found->second);
  }
  for (std::size_t i = 0; i < corners.points.size(); ++i)
    corners.points[i] /= corners.count[i];
  return corners;
}

// Groups with less than twice the radius from one to the next. No triangle of the shape reaches
// from one group to another. No point of another group lies in such a triangle's circle, so each
// group has its own triangulation.
std::vector<std::vector<int>> groups_of(const std::vector<Vector2d>& points, double radius) {
  const double reach = 2.0 * radius;
  std::unordered_map<std::int64_t, std::vector<int>> cells;
  for (std::size_t i = 0; i < points.size(); ++i)
    cells[cell_of(points[i], reach)].push_back(static_cast<int>(i));
  Union groups(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::int64_t here = cell_of(points[i], reach);
    for (const std::int64_t dx : {-1, 0, 1}) {
      for (const std::int64_t dy : {-1, 0, 1}) {
        const auto found = cells.find(here + dx * (std::int64_t{1} << 32) + dy);
        if (found == cells.end()) continue;
        for (const int j : found->second) {
          if (at(j) < i && (points[at(j)] - points[i]).squaredNorm() <= reach * reach)
            groups.join(j, static_cast<int>(i));
        }
      }
    }
  }
  std::vector<std::vector<int>> result;
  std::vector<int> group_of_root(points.size(), -1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    int& group = group_of_root[at(groups.root(static_cast<int>(i)))];
    if (group < 0) {
      group = static_cast<int>(result.size());
      result.emplace_back();
    }
    result[at(group)].push_back(static_cast<int>(i));
  }
  return result;
}

double circumradius(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  const Vector2d u = b - a;
  const Vector2d v = c - a;
  const double doubled_area = std::abs(u.x() * v.y() - u.y() * v.x());
  if (doubled_area <= 0.0) return std::numeric_limits<double>::infinity();
  return u.norm() * v.norm() * (u - v).norm() / (2.0 * doubled_area);
}

// For each corner of a group the first corner of its cluster (an index into the group), or -1.
std::vector<int> shape_of(const std::vector<Vector2d>& corners, double radius) {
  Union clusters(corners.size());
  std::vector<char> inside(corners.size(), 0);
  for (const auto& t : delaunay_triangles(corners)) {
    if (circumradius(corners[at(t[0])], corners[at(t[1])], corners[at(t[2])]) > radius) continue;
    for (const int corner : t)
      inside[at(corner)] = 1;
    clusters.join(t[0], t[1]);
    clusters.join(t[0], t[2]);
  }
  // Nothing but a spot, or two beside each other: no triangle, and yet the sharpest of clusters.
  const bool spot = std::none_of(inside.begin(), inside.end(), [](char in) { return in != 0; });
  std::vector<int> result(corners.size(), -1);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (spot) result[i] = 0;
    if (inside[i] != 0) result[i] = clusters.root(static_cast<int>(i));
  }
  return result;
}

}  // namespace

std::vector<int> alpha_clusters(const std::vector<Vector2d>& points, double radius_m) {
  const Corners corners = corners_of(points, radius_m / kCornersPerRadius);
  const auto groups = groups_of(corners.points, radius_m);
  std::vector<int> first_corner(corners.points.size(), -1);
  parallel_for(groups.size(), 8, [&](std::size_t g) {
    std::vector<Vector2d> own;
    own.reserve(groups[g].size());
    for (const int corner : groups[g])
      own.push_back(corners.points[at(corner)]);
    const std::vector<int> shape = shape_of(own, radius_m);
    for (std::size_t i = 0; i < shape.size(); ++i) {
      if (shape[i] >= 0) first_corner[at(groups[g][i])] = groups[g][at(shape[i])];
    }
  });
  std::vector<int> number_of_corner(corners.points.size(), -1);
  std::vector<int> result(points.size(), -1);
  int clusters = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int first = first_corner[at(corners.of_point[i])];
    if (first < 0) continue;
    if (number_of_corner[at(first)] < 0) number_of_corner[at(first)] = clusters++;
    result[i] = number_of_corner[at(first)];
  }
  return result;
}

}  // namespace understory
