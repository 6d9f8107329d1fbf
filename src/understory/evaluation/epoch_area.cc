#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/evaluation/trees/tree_changes.h"

namespace understory {
namespace {

using Eigen::Vector2d;

double turn(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Counterclockwise, by Andrew's monotone chain.
std::vector<Vector2d> convex_hull(std::vector<Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Vector2d& p, const Vector2d& q) {
    return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
  });
  std::vector<Vector2d> hull;
  for (const bool upper : {false, true}) {
    const std::size_t begin = hull.size();
    for (const Vector2d& point : points) {
      while (hull.size() >= begin + 2 && turn(hull[hull.size() - 2], hull.back(), point) <= 0.0)
        hull.pop_back();
      hull.push_back(point);
    }
    if (!hull.empty()) hull.pop_back();
    if (!upper) std::reverse(points.begin(), points.end());
  }
  return hull;
}

PlaneCells cells_of_path(const std::vector<Vector2d>& path, double reach_m) {
  return PlaneCells(
      path.size(), reach_m, [&](std::size_t k) { return path[k].x(); },
      [&](std::size_t k) { return path[k].y(); });
}

// Whether any place of the path is within reach.
bool reaches(const std::vector<Vector2d>& path, const PlaneCells& cells, double reach_m, double x,
             double y) {
  bool found = false;
  cells.around(x, y, [&](std::size_t k) {
    found = found || std::hypot(path[k].x() - x, path[k].y() - y) <= reach_m;
  });
  return found;
}

// The least of rising reaches within which a share of the trees stands.
double reach_of(const std::vector<Tree>& trees, const std::vector<Vector2d>& path) {
  using namespace evaluation_constants::tree_changes;
  double reach_m = kLeastReachM;
  for (; reach_m < kMostReachM; reach_m *= kReachStep) {
    const PlaneCells cells = cells_of_path(path, reach_m);
    const auto within = std::count_if(trees.begin(), trees.end(), [&](const Tree& tree) {
      return reaches(path, cells, reach_m, tree.x, tree.y);
    });
    if (static_cast<double>(within) >= kReachShare * static_cast<double>(trees.size())) break;
  }
  return reach_m;
}

}  // namespace

EpochArea EpochArea::from_trees(const std::vector<Tree>& trees) {
  EpochArea area;
  std::vector<Vector2d> places;
  for (const Tree& tree : trees)
    places.emplace_back(tree.x, tree.y);
  area.hull_ = convex_hull(std::move(places));
  area.meaning_ = "the convex hull of its trees";
  return area;
}

EpochArea EpochArea::from_path(const std::vector<Tree>& trees, const Trajectory& path) {
  using namespace evaluation_constants::tree_changes;
  EpochArea area;
  for (const StampedPose& pose : path) {
    const Vector2d at = pose.world_from_body.translation().head<2>();
    if (area.path_.empty() || (at - area.path_.back()).norm() > kPathStepM)
      area.path_.push_back(at);
  }
  area.reach_m_ = reach_of(trees, area.path_);
  area.cells_ = cells_of_path(area.path_, area.reach_m_);
  area.meaning_ = fmt::format("{:.1f} m around its path", area.reach_m_);
  return area;
}

bool EpochArea::holds(double x, double y) const {
  if (cells_) return reaches(path_, *cells_, reach_m_, x, y);
  if (hull_.size() < 3) return false;
  for (std::size_t k = 0; k < hull_.size(); ++k)
    if (turn(hull_[k], hull_[(k + 1) % hull_.size()], {x, y}) < 0.0) return false;
  return true;
}

}  // namespace understory
