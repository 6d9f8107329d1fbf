#include "understory/map/stem_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "understory/util/error.h"

namespace understory {
namespace {

// A tree while it is gathered (Welford's running moments).
struct Gathered {
  MappedStem stem;
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  Eigen::Vector3d axes = Eigen::Vector3d::Zero();
  double dbh_squares = 0.0;
};

class Gatherer {
 public:
  explicit Gatherer(double merge_m) : merge_m_(merge_m) {}

  void add(const Eigen::Vector3d& point, const Eigen::Vector3d& axis, double dbh_m, int view) {
    const int found = nearest(point);
    if (found < 0) {
      cells_[key(point.x(), point.y(), 0, 0)].push_back(static_cast<int>(trees_.size()));
      trees_.emplace_back();
      trees_.back().stem.first_view = view;
      update(trees_.back(), point, axis, dbh_m, view);
      return;
    }
    Gathered& tree = trees_[static_cast<std::size_t>(found)];
    const Eigen::Vector3d before = tree.stem.point_in_world;
    update(tree, point, axis, dbh_m, view);
    move(found, before, tree.stem.point_in_world);
  }

  [[nodiscard]] const std::vector<Gathered>& trees() const { return trees_; }

 private:
  [[nodiscard]] std::uint64_t key(double x, double y, int dx, int dy) const {
    const auto cell = [this](double v) {
      return static_cast<std::int64_t>(std::floor(v / merge_m_));
    };
    return (static_cast<std::uint64_t>(cell(x) + dx) << 32) ^
           (static_cast<std::uint64_t>(cell(y) + dy) & 0xffffffffU);
  }

  [[nodiscard]] int nearest(const Eigen::Vector3d& point) const {
    int best = -1;
    double best_squared = merge_m_ * merge_m_;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const auto at = cells_.find(key(point.x(), point.y(), dx, dy));
        if (at == cells_.end()) continue;
        for (const int i : at->second) {
          const double squared = (trees_[static_cast<std::size_t>(i)].stem.point_in_world - point)
                                     .head<2>()
                                     .squaredNorm();
          if (squared > best_squared || (squared == best_squared && i > best)) continue;
          best = i;
          best_squared = squared;
        }
      }
    }
    return best;
  }

  static void update(Gathered& tree, const Eigen::Vector3d& point, const Eigen::Vector3d& axis,
                     double dbh_m, int view) {
    MappedStem& stem = tree.stem;
    ++stem.sights;
    stem.last_view = view;
    const Eigen::Vector3d d = point - stem.point_in_world;
    stem.point_in_world += d / stem.sights;
    tree.squares += d.head<2>().cwiseProduct((point - stem.point_in_world).head<2>());
    if (axis.allFinite()) tree.axes += axis.z() < 0.0 ? Eigen::Vector3d(-axis) : axis;
    if (!std::isfinite(dbh_m)) return;
    if (stem.dbh_sights == 0) stem.dbh_m = 0.0;
    ++stem.dbh_sights;
    const double e = dbh_m - stem.dbh_m;
    stem.dbh_m += e / stem.dbh_sights;
    tree.dbh_squares += e * (dbh_m - stem.dbh_m);
  }

  void move(int tree, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    const std::uint64_t before = key(from.x(), from.y(), 0, 0);
    const std::uint64_t after = key(to.x(), to.y(), 0, 0);
    if (before == after) return;
    std::vector<int>& old = cells_[before];
    old.erase(std::find(old.begin(), old.end(), tree));
    cells_[after].push_back(tree);
  }

  double merge_m_;
  std::vector<Gathered> trees_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;
};

}  // namespace

std::vector<MappedStem> build_stem_map(const std::vector<StemView>& views,
                                       const std::vector<Pose>& world_from_body,
                                       const StemMapConfig& config) {
  UNDERSTORY_CHECK(views.size() == world_from_body.size());
  Gatherer gatherer(config.merge_m);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Matrix3d rotation = world_from_body[i].rotation_matrix();
    for (const Stem& stem : views[i].stems) {
      gatherer.add(rotation * stem.point.cast<double>() + world_from_body[i].translation(),
                   rotation * stem.axis.cast<double>(), static_cast<double>(stem.dbh_m),
                   static_cast<int>(i));
    }
  }
  std::vector<MappedStem> result;
  for (const Gathered& tree : gatherer.trees()) {
    if (tree.stem.sights < config.min_sights) continue;
    MappedStem stem = tree.stem;
    stem.variance_m2 = tree.squares / std::max(1, stem.sights - 1);
    if (tree.axes.norm() > 0.0) stem.axis_in_world = tree.axes.normalized();
    if (stem.dbh_sights > 1)
      stem.dbh_sd_m = std::sqrt(tree.dbh_squares / (stem.dbh_sights - 1) / stem.dbh_sights);
    result.push_back(stem);
  }
  return result;
}

}  // namespace understory
