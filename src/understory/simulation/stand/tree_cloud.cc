#include "understory/simulation/stand/tree_cloud.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "understory/geometry/kd_tree.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kSlice = 0.25;    // metres
constexpr float kThin = 0.007F;    // metres between points
constexpr float kFarthest = 0.2F;  // metres to a neighbour
constexpr float kLargest = 0.03F;  // radius of a disc
constexpr float kSmallest = 0.004F;
constexpr std::size_t kNeighbours = 10;

// Whether any of the points that were kept lies nearer than kThin: a result set of nanoflann.
struct KeptNearby {
  using DistanceType = float;
  using IndexType = std::uint32_t;
  const std::vector<bool>& kept;
  bool found = false;
  bool addPoint(float squared, std::uint32_t i) {
    found = found || (kept[i] && squared < kThin * kThin);
    return !found;
  }
  [[nodiscard]] float worstDist() const { return kThin * kThin; }
  [[nodiscard]] bool full() const { return true; }
  [[nodiscard]] bool empty() const { return !found; }
  [[nodiscard]] std::size_t size() const { return found ? 1 : 0; }
  void sort() {}
};

Points thinned(const Points& points) {
  const KdTreePoints adaptor{&points};
  const KdTree tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  std::vector<bool> is_kept(points.size(), false);
  Points kept;
  for (std::size_t i = 0; i < points.size(); ++i) {
    KeptNearby nearby{is_kept};
    tree.findNeighbors(nearby, points[i].data(), {});
    if (nearby.found) continue;
    is_kept[i] = true;
    kept.push_back(points[i]);
  }
  return kept;
}

TreeCloud::Disc disc_at(const Points& points, const KdTree& tree, std::size_t i) {
  std::array<std::uint32_t, kNeighbours + 1> near{};  // with the point itself
  std::array<float, kNeighbours + 1> squared{};
  std::size_t used = tree.knnSearch(points[i].data(), near.size(), near.data(), squared.data());
  while (used > 1 && squared[used - 1] > kFarthest * kFarthest)
    --used;
  TreeCloud::Disc disc;
  disc.centre = points[i];
  disc.radius_m =
      std::clamp(std::sqrt(squared[std::min<std::size_t>(4, used - 1)]), kSmallest, kLargest);
  if (used < 4) return disc;
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  for (std::size_t k = 0; k < used; ++k)
    mean += points[near[k]] / static_cast<float>(used);
  Eigen::Matrix3f scatter = Eigen::Matrix3f::Zero();
  for (std::size_t k = 0; k < used; ++k) {
    const Eigen::Vector3f off = points[near[k]] - mean;
    scatter += off * off.transpose();
  }
  disc.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f>(scatter).eigenvectors().col(0);
  return disc;
}

// Where points lie most densely at the height of the breast: the stem.
Eigen::Vector2f densest(const Points& points) {
  std::map<std::pair<int, int>, int> cells;
  std::pair<int, int> best;
  int most = 0;
  for (const Eigen::Vector3f& point : points) {
    if (point.z() < 0.8F || point.z() > 1.8F) continue;
    const std::pair<int, int> cell(static_cast<int>(std::floor(point.x() / 0.1F)),
                                   static_cast<int>(std::floor(point.y() / 0.1F)));
    const int count = ++cells[cell];
    if (count > most) {
      most = count;
      best = cell;
    }
  }
  return {0.1F * (static_cast<float>(best.first) + 0.5F),
          0.1F * (static_cast<float>(best.second) + 0.5F)};
}

// Middle of the stem, slice by slice from the ground up; and how far from it bark may lie.
struct Axis {
  std::vector<Eigen::Vector2f> middle;
  std::vector<float> reach_m;
  [[nodiscard]] std::size_t slice(float z) const {
    const auto at = static_cast<std::size_t>(std::max(0.0F, z) / static_cast<float>(kSlice));
    return std::min(at, middle.size() - 1);
  }
};

Axis follow_stem(const Points& points, double height_m, double dbh_m) {
  const auto slices = static_cast<std::size_t>(height_m / kSlice) + 1;
  std::vector<Points> by_slice(slices);
  Axis axis;
  for (std::size_t i = 0; i < slices; ++i) {
    const double rest = 1.0 - kSlice * (static_cast<double>(i) + 0.5) / height_m;
    axis.reach_m.push_back(static_cast<float>(0.75 * dbh_m * std::max(rest, 0.1) + 0.03));
  }
  axis.middle.assign(slices, densest(points));
  for (const Eigen::Vector3f& point : points)
    by_slice[axis.slice(point.z())].push_back(point);
  const auto refine = [&](std::size_t i, const Eigen::Vector2f& from) {
    Eigen::Vector2f middle = from;
    for (int round = 0; round < 4; ++round) {
      Eigen::Vector2f low = middle;
      Eigen::Vector2f high = middle;
      for (const Eigen::Vector3f& point : by_slice[i]) {
        if ((point.head<2>() - middle).norm() > axis.reach_m[i]) continue;
        low = low.cwiseMin(point.head<2>());
        high = high.cwiseMax(point.head<2>());
      }
      middle = 0.5F * (low + high);
    }
    axis.middle[i] = middle;
  };
  const std::size_t breast = axis.slice(1.3F);
  refine(breast, axis.middle[breast]);
  for (std::size_t i = breast + 1; i < slices; ++i)
    refine(i, axis.middle[i - 1]);
  for (std::size_t i = breast; i-- > 0;)
    refine(i, axis.middle[i + 1]);
  return axis;
}

}  // namespace

TreeCloud read_tree_cloud(const std::string& path, double dbh_m) {
  Log log;
  const PointCloudFile file = read_cloud(path, log);
  Points points = file.points;
  float lowest = 1e9F;
  float highest = -1e9F;
  for (const Eigen::Vector3f& point : points) {
    lowest = std::min(lowest, point.z());
    highest = std::max(highest, point.z());
  }
  if (points.size() < 100 || highest - lowest < 1.5F) {
    throw InputError(path, "", "expected the cloud of a tree: 100 points, 1.5 m high at least");
  }
  for (Eigen::Vector3f& point : points)
    point.z() -= lowest;
  points = thinned(points);
  TreeCloud tree;
  tree.height_m = highest - lowest;
  const Axis axis = follow_stem(points, tree.height_m, dbh_m);
  const Eigen::Vector3f foot(axis.middle[0].x(), axis.middle[0].y(), 0.0F);
  const std::size_t above = axis.slice(3.0F);
  if (above > 0) {
    tree.lean = ((axis.middle[above] - axis.middle[0]) / (kSlice * static_cast<double>(above)))
                    .cast<double>();
  }
  const KdTreePoints adaptor{&points};
  const KdTree kd(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  for (std::size_t i = 0; i < points.size(); ++i) {
    TreeCloud::Disc disc = disc_at(points, kd, i);
    const std::size_t slice = axis.slice(disc.centre.z());
    const bool stem = (disc.centre.head<2>() - axis.middle[slice]).norm() <= axis.reach_m[slice] &&
                      disc.centre.z() < 0.85F * static_cast<float>(tree.height_m);
    disc.centre -= foot;
    (stem ? tree.stem : tree.crown).push_back(disc);
  }
  return tree;
}

}  // namespace understory
