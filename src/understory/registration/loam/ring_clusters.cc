#include "understory/registration/loam/ring_clusters.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "understory/registration/registration_constants.h"

namespace understory {
namespace {

using namespace registration_constants::ring_features;

std::size_t azimuth_column(const Eigen::Vector3f& point) {
  const double azimuth = std::atan2(static_cast<double>(point.y()), static_cast<double>(point.x()));
  const double share = 0.5 + 0.5 * azimuth / std::numbers::pi;
  return std::min(static_cast<std::size_t>(share * kAzimuthBins), kAzimuthBins - 1);
}

// The angle at the farther one of two points, between its ray and the line to the nearer one.
bool on_one_surface(const Eigen::Vector3f& a, const Eigen::Vector3f& b, double least_angle_rad) {
  const Eigen::Vector3d near = a.cast<double>();
  const Eigen::Vector3d far = b.cast<double>();
  const double near_m = near.norm();
  const double far_m = far.norm();
  const double product = near_m * far_m;
  if (product <= 0.0) return false;
  const double shorter = std::min(near_m, far_m);
  const double across = shorter * near.cross(far).norm() / product;
  const double along = std::max(near_m, far_m) - shorter * near.dot(far) / product;
  return std::atan2(across, along) > least_angle_rad;
}

// Joins the cells of an image into clusters.
class ClusterSearch {
 public:
  ClusterSearch(const Points& points, const RangeImage& image, const std::vector<char>& left_out,
                const RingClustersConfig& config)
      : points_(points),
        image_(image),
        least_angle_(config.angle_deg * std::numbers::pi / 180.0),
        taken_(image.rings() * image.columns(), 0) {
    for (std::size_t cell = 0; cell < taken_.size(); ++cell) {
      const std::uint32_t point = image_.at(cell);
      if (point == RangeImage::kNoPoint || left_out[point] != 0) taken_[cell] = 1;
    }
  }

  // The cells of the cluster that holds this one; none if it is taken.
  const std::vector<std::size_t>& from(std::size_t cell) {
    cluster_.clear();
    take(cell);
    for (std::size_t next = 0; next < cluster_.size(); ++next)
      visit_neighbours(cluster_[next]);
    return cluster_;
  }

 private:
  void take(std::size_t cell) {
    if (taken_[cell] != 0) return;
    taken_[cell] = 1;
    cluster_.push_back(cell);
  }
  void visit_neighbours(std::size_t cell) {
    const std::size_t columns = image_.columns();
    const std::size_t ring = cell / columns;
    const std::size_t column = cell % columns;
    for (const bool back : {false, true}) {
      for (std::size_t step = 1; step <= kColumnGap; ++step)
        if (visit(cell, ring, column + (back ? columns - step : step))) break;
    }
    for (const std::size_t beside : {image_.ring_above(ring), image_.ring_below(ring)}) {
      if (beside == ring) continue;
      for (std::size_t step = 0; step <= kColumnGap; ++step)
        if (visit(cell, beside, column + step) || visit(cell, beside, column + columns - step))
          break;
    }
  }
  // Takes the cell there if it is on one surface with `from`. Whether a point was measured there.
  bool visit(std::size_t from, std::size_t ring, std::size_t column) {
    const std::size_t columns = image_.columns();
    const std::size_t other = ring * columns + column % columns;
    if (other == from || image_.at(other) == RangeImage::kNoPoint) return false;
    if (taken_[other] == 0 &&
        on_one_surface(points_[image_.at(from)], points_[image_.at(other)], least_angle_))
      take(other);
    return true;
  }

  const Points& points_;
  const RangeImage& image_;
  double least_angle_;
  std::vector<char> taken_;
  std::vector<std::size_t> cluster_;
};

// For each ring the next one with points, in the order in which `rings` are given; for the first of
// them itself.
std::vector<std::size_t> rings_before(const std::vector<std::size_t>& rings,
                                      const std::vector<char>& has_points) {
  std::vector<std::size_t> before(rings.size());
  for (std::size_t k = 0, last = rings.empty() ? 0 : rings.front(); k < rings.size(); ++k) {
    before[rings[k]] = last;
    if (has_points[rings[k]] != 0) last = rings[k];
  }
  return before;
}

bool cluster_counts(const std::vector<std::size_t>& cells, std::size_t columns, int min_points) {
  if (cells.size() >= static_cast<std::size_t>(min_points)) return true;
  if (cells.size() < kUprightPoints) return false;
  std::vector<std::size_t> rings;
  for (const std::size_t cell : cells)
    rings.push_back(cell / columns);
  std::sort(rings.begin(), rings.end());
  const auto end = std::unique(rings.begin(), rings.end());
  return static_cast<std::size_t>(end - rings.begin()) >= kUprightRings;
}

}  // namespace

void describe(ConfigTable& table, RingClustersConfig& config) {
  table.add("cluster_points", config.min_points, {0, 1000}, "",
            "points at least of an object that is matched; 0: all are");
  table.add("cluster_angle_deg", config.angle_deg, {1.0, 89.0}, "deg",
            "neighbouring points lie on one object if their line is seen at a larger angle");
}

RangeImage::RangeImage(const Points& points, const std::vector<std::uint16_t>& ring)
    : cell_(points.size()) {
  for (const std::uint16_t number : ring)
    rings_ = std::max<std::size_t>(rings_, number + std::size_t{1});
  point_.assign(rings_ * kAzimuthBins, kNoPoint);
  for (std::size_t i = 0; i < points.size(); ++i) {
    cell_[i] = ring[i] * kAzimuthBins + azimuth_column(points[i]);
    point_[cell_[i]] = static_cast<std::uint32_t>(i);
  }
  std::vector<char> has_points(rings_, 0);
  for (const std::uint16_t number : ring)
    has_points[number] = 1;
  std::vector<std::size_t> order(rings_);
  std::iota(order.begin(), order.end(), std::size_t{0});
  below_ = rings_before(order, has_points);
  std::reverse(order.begin(), order.end());
  above_ = rings_before(order, has_points);
}

std::size_t RangeImage::columns() const {
  return kAzimuthBins;
}

std::vector<char> clustered_points(const Points& points, const RangeImage& image,
                                   const std::vector<char>& left_out,
                                   const RingClustersConfig& config) {
  std::vector<char> counts(image.rings() * image.columns(), 0);
  ClusterSearch search(points, image, left_out, config);
  for (std::size_t cell = 0; cell < counts.size(); ++cell) {
    const std::vector<std::size_t>& cluster = search.from(cell);
    if (!cluster_counts(cluster, image.columns(), config.min_points)) continue;
    for (const std::size_t part : cluster)
      counts[part] = 1;
  }
  std::vector<char> clustered(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    clustered[i] = counts[image.cell_of(i)];
  return clustered;
}

}  // namespace understory
