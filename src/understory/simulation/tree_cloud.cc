#include "understory/simulation/tree_cloud.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <utility>

#include "understory/recording/cloud_file.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kSlice = 0.25;    // metres
constexpr float kThin = 0.007F;    // metres between points
constexpr float kCell = 0.06F;     // in which neighbours are looked for first
constexpr float kLargest = 0.03F;  // radius of a disc
constexpr float kSmallest = 0.004F;
constexpr std::size_t kNeighbours = 10;

using Points = std::vector<Eigen::Vector3f>;

// Points by cubes.
class Cubes {
 public:
  explicit Cubes(float cell) : cell_(cell) {}
  void add(const Eigen::Vector3f& point, std::size_t number) {
    cubes_[key(index(point))].push_back(static_cast<std::uint32_t>(number));
  }
  // Calls `visit` for each number within `reach` cubes of the point's.
  template <typename Visit>
  void near(const Eigen::Vector3f& point, int reach, const Visit& visit) const {
    const Eigen::Vector3i middle = index(point);
    for (int x = -reach; x <= reach; ++x) {
      for (int y = -reach; y <= reach; ++y) {
        for (int z = -reach; z <= reach; ++z) {
          const auto found = cubes_.find(key(middle + Eigen::Vector3i(x, y, z)));
          if (found == cubes_.end()) continue;
          for (const std::uint32_t number : found->second)
            visit(number);
        }
      }
    }
  }

 private:
  [[nodiscard]] Eigen::Vector3i index(const Eigen::Vector3f& point) const {
    return (point / cell_).array().floor().cast<int>();
  }
  static std::uint64_t key(const Eigen::Vector3i& i) {
    const auto part = [](int value) { return static_cast<std::uint64_t>(value + (1 << 20)); };
    return part(i.x()) << 42 | part(i.y()) << 21 | part(i.z());
  }
  float cell_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cubes_;
};

Points thinned(const Points& points) {
  Cubes cubes(kThin);
  Points kept;
  for (const Eigen::Vector3f& point : points) {
    bool free = true;
    cubes.near(point, 1, [&](std::size_t other) {
      free = free && (kept[other] - point).squaredNorm() >= kThin * kThin;
    });
    if (!free) continue;
    cubes.add(point, kept.size());
    kept.push_back(point);
  }
  return kept;
}

TreeCloud::Disc disc_at(const Points& points, const Cubes& cubes, std::size_t i) {
  std::vector<std::pair<float, std::size_t>> near;
  for (int reach = 1; reach <= 3 && near.size() <= kNeighbours; ++reach) {
    near.clear();
    cubes.near(points[i], reach, [&](std::size_t other) {
      near.emplace_back((points[other] - points[i]).squaredNorm(), other);
    });
  }
  const std::size_t used = std::min(near.size(), kNeighbours + 1);  // with the point itself
  std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(used), near.end());
  TreeCloud::Disc disc;
  disc.centre = points[i];
  disc.radius_m =
      std::clamp(std::sqrt(near[std::min<std::size_t>(4, used - 1)].first), kSmallest, kLargest);
  if (used < 4) return disc;
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  for (std::size_t k = 0; k < used; ++k)
    mean += points[near[k].second] / static_cast<float>(used);
  Eigen::Matrix3f scatter = Eigen::Matrix3f::Zero();
  for (std::size_t k = 0; k < used; ++k) {
    const Eigen::Vector3f off = points[near[k].second] - mean;
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
  Cubes cubes(kCell);
  for (std::size_t i = 0; i < points.size(); ++i)
    cubes.add(points[i], i);
  for (std::size_t i = 0; i < points.size(); ++i) {
    TreeCloud::Disc disc = disc_at(points, cubes, i);
    const std::size_t slice = axis.slice(disc.centre.z());
    const bool stem = (disc.centre.head<2>() - axis.middle[slice]).norm() <= axis.reach_m[slice] &&
                      disc.centre.z() < 0.85F * static_cast<float>(tree.height_m);
    disc.centre -= foot;
    (stem ? tree.stem : tree.crown).push_back(disc);
  }
  return tree;
}

}  // namespace understory
