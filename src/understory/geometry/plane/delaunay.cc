#include "understory/geometry/plane/delaunay.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Above 0 if d lies inside the circle through the counter-clockwise a, b, c.
double in_circle(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const Vector2d p = a - d;
  const Vector2d q = b - d;
  const Vector2d r = c - d;
  const double pp = p.squaredNorm();
  const double qq = q.squaredNorm();
  const double rr = r.squaredNorm();
  return p.x() * (q.y() * rr - r.y() * qq) - p.y() * (q.x() * rr - r.x() * qq) +
         pp * (q.x() * r.y() - r.x() * q.y());
}

struct Triangle {
  std::array<int, 3> corner;
  std::array<int, 3> beyond;  // triangle across the edge that faces the corner, -1: none
  bool alive = true;
};

// Incremental insertion (Bowyer, Watson 1981) into a triangle far around all points.
class Mesh {
 public:
  explicit Mesh(std::vector<Vector2d> points) : points_(std::move(points)) {
    const int n = static_cast<int>(points_.size());
    constexpr double kFar = 1e4;  // in units of the extent
    points_.emplace_back(-kFar, -kFar);
    points_.emplace_back(kFar, -kFar);
    points_.emplace_back(0.0, kFar);
    triangles_.push_back({{n, n + 1, n + 2}, {-1, -1, -1}});
  }

  void insert(int point) {
    const int first = locate(point);
    hole_.clear();
    stack_.assign(1, first);
    triangles_[index(first)].alive = false;
    while (!stack_.empty()) {
      const int t = stack_.back();
      stack_.pop_back();
      hole_.push_back(t);
      for (const int next : triangles_[index(t)].beyond) {
        if (next < 0 || !triangles_[index(next)].alive || !holds(next, point)) continue;
        triangles_[index(next)].alive = false;
        stack_.push_back(next);
      }
    }
    fill(point);
  }

  [[nodiscard]] std::vector<std::array<int, 3>> inner() const {
    const int n = static_cast<int>(points_.size()) - 3;
    std::vector<std::array<int, 3>> result;
    for (const Triangle& triangle : triangles_) {
      const auto& c = triangle.corner;
      if (triangle.alive && c[0] < n && c[1] < n && c[2] < n) result.push_back(c);
    }
    return result;
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  [[nodiscard]] const Vector2d& at(int point) const { return points_[index(point)]; }

  [[nodiscard]] bool holds(int t, int point) const {
    const auto& c = triangles_[index(t)].corner;
    return in_circle(at(c[0]), at(c[1]), at(c[2]), at(point)) > 0.0;
  }

  // Walks to the triangle around the point.
  [[nodiscard]] int locate(int point) const {
    int t = static_cast<int>(triangles_.size()) - 1;
    while (!triangles_[index(t)].alive)
      --t;
    for (std::size_t step = 0; step < triangles_.size(); ++step) {
      const Triangle& triangle = triangles_[index(t)];
      int next = -1;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vector2d& a = at(triangle.corner[(k + 1) % 3]);
        const Vector2d& b = at(triangle.corner[(k + 2) % 3]);
        if (cross(a, b, at(point)) < 0.0) next = triangle.beyond[k];
      }
      if (next < 0) return t;
      t = next;
    }
    return t;
  }

  // New triangles from the point to the rim of the hole.
  void fill(int point) {
    struct Rim {
      int from, to, beyond;
    };
    std::vector<Rim> rim;
    for (const int t : hole_) {
      const Triangle triangle = triangles_[index(t)];
      for (std::size_t k = 0; k < 3; ++k) {
        const int beyond = triangle.beyond[k];
        if (beyond < 0 || triangles_[index(beyond)].alive)
          rim.push_back({triangle.corner[(k + 1) % 3], triangle.corner[(k + 2) % 3], beyond});
      }
    }
    const int base = static_cast<int>(triangles_.size());
    for (std::size_t i = 0; i < rim.size(); ++i) {
      Triangle added{{point, rim[i].from, rim[i].to}, {rim[i].beyond, -1, -1}};
      for (std::size_t j = 0; j < rim.size(); ++j) {
        if (rim[j].from == rim[i].to) added.beyond[1] = base + static_cast<int>(j);
        if (rim[j].to == rim[i].from) added.beyond[2] = base + static_cast<int>(j);
      }
      if (rim[i].beyond >= 0) relink(rim[i].beyond, rim[i].from, base + static_cast<int>(i));
      triangles_.push_back(added);
    }
  }

  void relink(int t, int rim_from, int to) {
    Triangle& triangle = triangles_[index(t)];
    for (std::size_t k = 0; k < 3; ++k) {
      // Seen from outside the edge runs the other way.
      if (triangle.corner[(k + 2) % 3] == rim_from) triangle.beyond[k] = to;
    }
  }

  std::vector<Vector2d> points_;
  std::vector<Triangle> triangles_;
  std::vector<int> hole_;
  std::vector<int> stack_;
};

// Points brought to the unit square and moved apart by a millionth of their spacing. The corners of
// a square grid then do not lie on one circle; -1 in `order` for doubles.
std::vector<Vector2d> spread(const std::vector<Vector2d>& points) {
  Vector2d low = points.front();
  Vector2d high = points.front();
  for (const Vector2d& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const double extent = std::max((high - low).maxCoeff(), 1e-9);
  const double jitter = 1e-6 / std::sqrt(static_cast<double>(points.size()));
  std::vector<Vector2d> result;
  std::uint32_t state = 1;
  for (const Vector2d& point : points) {
    Vector2d moved = (point - low) / extent;
    for (int k = 0; k < 2; ++k) {
      state = state * 1664525U + 1013904223U;
      moved[k] += jitter * (static_cast<double>(state >> 8) / 16'777'216.0 - 0.5);
    }
    result.push_back(moved);
  }
  return result;
}

bool on_one_line(const std::vector<Vector2d>& unit) {
  std::size_t far = 0;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    if ((unit[i] - unit[0]).squaredNorm() > (unit[far] - unit[0]).squaredNorm()) far = i;
  }
  return std::all_of(unit.begin(), unit.end(), [&](const Vector2d& point) {
    return std::abs(cross(unit[0], unit[far], point)) < 1e-5;
  });
}

}  // namespace

std::vector<std::array<int, 3>> delaunay_triangles(const std::vector<Vector2d>& points) {
  if (points.size() < 3) return {};
  const std::vector<Vector2d> unit = spread(points);
  if (on_one_line(unit)) return {};
  // Along x, so that the walk to the next point is short; doubles stand together.
  std::vector<int> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int i) {
    const Vector2d& p = points[static_cast<std::size_t>(i)];
    return std::array<double, 2>{p.x(), p.y()};
  };
  sort_stably(order, [&](int a, int b) { return key(a) < key(b); });
  Mesh mesh(unit);
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(order[i]) == key(order[i - 1])) continue;
    mesh.insert(order[i]);
  }
  return mesh.inner();
}

std::vector<std::vector<int>> natural_neighbours(const std::vector<Vector2d>& points) {
  std::vector<std::vector<int>> neighbours(points.size());
  for (const auto& triangle : delaunay_triangles(points)) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = triangle[k];
      const int b = triangle[(k + 1) % 3];
      neighbours[static_cast<std::size_t>(a)].push_back(b);
      neighbours[static_cast<std::size_t>(b)].push_back(a);
    }
  }
  for (auto& list : neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

double mean_neighbour_distance(const std::vector<Vector2d>& points) {
  const auto triangles = delaunay_triangles(points);
  struct Sum {
    double distance = 0.0;
    int edges = 0;
    int balance = 0;  // edges out less edges in: 0 all around, not 0 on the hull
  };
  std::vector<Sum> sums(points.size());
  for (const auto& triangle : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(triangle[k]);
      const auto b = static_cast<std::size_t>(triangle[(k + 1) % 3]);
      const double d = (points[a] - points[b]).norm();
      sums[a].distance += d;
      ++sums[a].edges;
      sums[a].balance += static_cast<int>(b) + 1;
      sums[b].balance -= static_cast<int>(a) + 1;
    }
  }
  // Inner points start one edge of each triangle around them. So each neighbour counts once, as it
  // comes once as the next corner and once as the one before.
  double inner = 0.0;
  double all = 0.0;
  int inner_count = 0;
  int count = 0;
  for (const Sum& sum : sums) {
    if (sum.edges == 0) continue;
    all += sum.distance / sum.edges;
    ++count;
    if (sum.balance != 0) continue;
    inner += sum.distance / sum.edges;
    ++inner_count;
  }
  if (inner_count >= 10) return inner / inner_count;
  return count > 0 ? all / count : 0.0;
}

}  // namespace understory
