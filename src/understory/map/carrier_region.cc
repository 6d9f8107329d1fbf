#include "understory/map/carrier_region.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/geometry/path_pose.h"
#include "understory/geometry/voxel_index.h"
#include "understory/geometry/voxel_key.h"
#include "understory/map/map_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace map_constants::carrier_region;

constexpr std::uint32_t kNoVoxel = UINT32_MAX;
constexpr double kBeyond = 1.0;  // steps of the path: the last scan ends after its last pose

// A cube of voxels around the lidar.
struct Grid {
  Eigen::Vector3d centre;
  double reach_m = 0.0;
  int edge = 0;

  Grid(const Eigen::Vector3d& at, double reach)
      : centre(at), reach_m(reach), edge(2 * static_cast<int>(std::ceil(reach / kVoxelM))) {}
  [[nodiscard]] std::size_t size() const {
    const auto n = static_cast<std::size_t>(edge);
    return n * n * n;
  }
  [[nodiscard]] std::uint32_t voxel_of(const Eigen::Vector3d& place) const {
    const Eigen::Vector3d from_centre = place - centre;
    if (!(from_centre.squaredNorm() < reach_m * reach_m)) return kNoVoxel;
    const auto at = [&](double value) {
      return std::clamp(voxel_floor(value / kVoxelM) + edge / 2, 0, edge - 1);
    };
    return static_cast<std::uint32_t>((at(from_centre.x()) * edge + at(from_centre.y())) * edge +
                                      at(from_centre.z()));
  }
  // Calls visit(voxel) for a voxel and those that touch it.
  template <typename Visit>
  void around(std::uint32_t voxel, const Visit& visit) const {
    const int i = static_cast<int>(voxel);
    const int at[3] = {i / (edge * edge), i / edge % edge, i % edge};
    for (int x = std::max(0, at[0] - 1); x <= std::min(edge - 1, at[0] + 1); ++x) {
      for (int y = std::max(0, at[1] - 1); y <= std::min(edge - 1, at[1] + 1); ++y) {
        for (int z = std::max(0, at[2] - 1); z <= std::min(edge - 1, at[2] + 1); ++z)
          visit(static_cast<std::uint32_t>((x * edge + y) * edge + z));
      }
    }
  }
};

std::uint64_t world_key(const Eigen::Vector3d& place, int x = 0, int y = 0, int z = 0) {
  return voxel_key(voxel_floor(place.x() / kWorldVoxelM) + x,
                   voxel_floor(place.y() / kWorldVoxelM) + y,
                   voxel_floor(place.z() / kWorldVoxelM) + z);
}

// Clouds of a part of the run, taken at places that are apart.
struct Stretch {
  struct Used {
    std::size_t cloud = 0;
    Pose world_from_body;
  };
  std::vector<Used> clouds;

  [[nodiscard]] bool suffices() const {
    if (clouds.size() < kFewestClouds) return false;
    double farthest = 0.0;
    for (const Used& a : clouds) {
      for (const Used& b : clouds)
        farthest = std::max(
            farthest, (a.world_from_body.translation() - b.world_from_body.translation()).norm());
    }
    return farthest >= kLeastWayM;
  }
};

class CarrierSearch {
 public:
  CarrierSearch(const KeyframeClouds& clouds, const std::vector<Keyframe>& keyframes,
                std::span<const StampedPose> path, const Grid& grid,
                const CarrierSearchConfig& config, const ProgressSink& progress)
      : clouds_(clouds),
        keyframes_(keyframes),
        path_(path),
        grid_(grid),
        config_(config),
        progress_(progress) {}

  // One entry a voxel; empty: none is of the carrier.
  std::vector<std::uint8_t> find() {
    choose_clouds();
    if (stretches_.empty()) return {};
    for (const Stretch& stretch : stretches_)
      count_hits(stretch);
    choose_candidates();
    if (std::count(candidate_.begin(), candidate_.end(), 1) == 0) return {};
    shown_.assign(grid_.size(), 0);
    elsewhere_.assign(grid_.size(), 0);
    for (const Stretch& stretch : stretches_)
      look_from_elsewhere(stretch);
    std::uint64_t shown = 0;
    for (std::size_t v = 0; v < candidate_.size(); ++v) {
      if (candidate_[v] == 0) continue;
      candidate_[v] = static_cast<double>(elsewhere_[v]) < kElsewhere * shown_[v] ? 1 : 0;
      shown += candidate_[v] != 0 ? shown_[v] : 0;
    }
    return shown >= kFewestShown * used_ ? std::move(candidate_) : std::vector<std::uint8_t>();
  }

 private:
  [[nodiscard]] Pose pose_of(const KeyframeCloud& cloud) const {
    const auto keyframe = static_cast<std::size_t>(cloud.id);
    UNDERSTORY_CHECK(keyframe < keyframes_.size());
    return keyframes_[keyframe].world_from_body * cloud.keyframe_from_body;
  }

  void choose_clouds() {
    std::size_t next = 0;
    for (std::size_t i = 0; i < kStretches; ++i) {
      next = std::max(next, i * clouds_.size() / kStretches);
      Stretch stretch;
      for (; next < clouds_.size() && stretch.clouds.size() < kCloudsOfStretch; ++next) {
        const Pose pose = pose_of(clouds_.read(next));
        const bool apart =
            stretch.clouds.empty() ||
            (pose.translation() - stretch.clouds.back().world_from_body.translation()).norm() >=
                kApartM;
        if (apart) stretch.clouds.push_back({next, pose});
        progress_.poll();
      }
      if (stretch.suffices()) stretches_.push_back(std::move(stretch));
    }
  }

  // In how many clouds each voxel has a point.
  void count_hits(const Stretch& stretch) {
    if (hits_.empty()) hits_.assign(grid_.size(), 0);
    std::vector<std::uint32_t> last(grid_.size(), 0);
    for (const Stretch::Used& used : stretch.clouds) {
      progress_.poll();
      ++used_;
      const KeyframeCloud cloud = clouds_.read(used.cloud);
      const PlacesAsMeasured places(cloud, path_);
      for (const KeyframePoint& point : cloud.points) {
        const std::uint32_t voxel = grid_.voxel_of(places(point));
        if (voxel == kNoVoxel || last[voxel] == used_) continue;
        last[voxel] = used_;
        ++hits_[voxel];
      }
    }
  }

  // What stays, and what touches it and is there now and then: a beam meets an edge or misses it.
  void choose_candidates() {
    std::vector<std::uint8_t> stays(grid_.size(), 0);
    for (std::size_t v = 0; v < hits_.size(); ++v)
      stays[v] = static_cast<double>(hits_[v]) >= config_.share * used_ ? 1 : 0;
    candidate_ = stays;
    for (std::uint32_t v = 0; v < stays.size(); ++v) {
      if (stays[v] == 0) continue;
      grid_.around(v, [&](std::uint32_t near) {
        if (static_cast<double>(hits_[near]) >= kShareBeside * used_) candidate_[near] = 1;
      });
    }
  }

  // Of the candidates' points: how many lie where other clouds show something from elsewhere.
  void look_from_elsewhere(const Stretch& stretch) {
    struct Point {
      std::uint32_t voxel;
      std::uint32_t cloud;
      Eigen::Vector3d place;
    };
    std::vector<Point> points;
    VoxelIndex occupied;  // world voxel -> the cloud that shows it, or kSeveral
    constexpr std::uint32_t kSeveral = UINT32_MAX - 1;
    Eigen::AlignedBox3d box;
    for (const Stretch::Used& used : stretch.clouds)
      box.extend(used.world_from_body * grid_.centre);
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(grid_.reach_m + 2.0 * kWorldVoxelM);
    box = Eigen::AlignedBox3d(box.min() - margin, box.max() + margin);
    for (std::uint32_t c = 0; c < stretch.clouds.size(); ++c) {
      progress_.poll();
      const KeyframeCloud cloud = clouds_.read(stretch.clouds[c].cloud);
      const PlacesAsMeasured places(cloud, path_);
      VoxelIndex own;  // one point of a world voxel
      for (const KeyframePoint& point : cloud.points) {
        const Eigen::Vector3d world = stretch.clouds[c].world_from_body *
                                      Eigen::Vector3f(point.x, point.y, point.z).cast<double>();
        if (!box.contains(world)) continue;
        const std::uint64_t key = world_key(world);
        const std::uint32_t voxel = grid_.voxel_of(places(point));
        if (voxel != kNoVoxel && candidate_[voxel] != 0) {
          if (own.find(key) == voxel) continue;
          own.set(key, voxel);
          points.push_back({voxel, c, world});
          continue;
        }
        const std::uint32_t shown_by = occupied.find(key);
        if (shown_by != c && shown_by != kSeveral)
          occupied.set(key, shown_by == VoxelIndex::kNone ? c : kSeveral);
      }
    }
    for (const Point& point : points) {
      ++shown_[point.voxel];
      if (is_shown(occupied, point.place, point.cloud)) ++elsewhere_[point.voxel];
    }
  }

  // Whether another cloud shows something at a place, or beside it.
  static bool is_shown(const VoxelIndex& occupied, const Eigen::Vector3d& place,
                       std::uint32_t cloud) {
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          const std::uint32_t by = occupied.find(world_key(place, x, y, z));
          if (by != VoxelIndex::kNone && by != cloud) return true;
        }
      }
    }
    return false;
  }

  const KeyframeClouds& clouds_;
  const std::vector<Keyframe>& keyframes_;
  std::span<const StampedPose> path_;
  Grid grid_;
  CarrierSearchConfig config_;
  const ProgressSink& progress_;
  std::vector<Stretch> stretches_;
  std::uint32_t used_ = 0;                // clouds
  std::vector<std::uint32_t> hits_;       // clouds by voxel
  std::vector<std::uint8_t> candidate_;   // by voxel
  std::vector<std::uint32_t> shown_;      // world voxels of its points, summed over clouds
  std::vector<std::uint32_t> elsewhere_;  // of these: shown by other clouds
};

}  // namespace

void describe(ConfigTable& table, CarrierSearchConfig& config) {
  table.add("reach_m", config.reach_m, {0.0, 10.0}, "m",
            "how far from the lidar the carrier's own points are looked for, to leave them out of "
            "the map; 0: they stay");
  table.add("share", config.share, {0.3, 1.0}, "",
            "share of the clouds that show a part of the carrier at one place of the body frame");
}

PlacesAsMeasured::PlacesAsMeasured(const KeyframeCloud& cloud, std::span<const StampedPose> path) {
  std::uint16_t last = 0;
  for (const KeyframePoint& point : cloud.points)
    last = std::max(last, point.t_10us);
  const Pose world_from_body = pose_on_path(path, cloud.stamp, kBeyond);
  for (std::uint32_t t = 0; t <= last; t += kStep10us) {
    const TimeNs middle = cloud.stamp + TimeNs{10'000} * (t + kStep10us / 2);
    then_from_body_.push_back(pose_on_path(path, middle, kBeyond).inverse() * world_from_body);
  }
}

CarrierRegion::CarrierRegion(const Eigen::Vector3d& centre_in_body, double reach_m,
                             std::vector<std::uint8_t> filled)
    : centre_(centre_in_body),
      reach_m_(reach_m),
      edge_(Grid(centre_in_body, reach_m).edge),
      filled_(std::move(filled)) {
  UNDERSTORY_CHECK(filled_.empty() || filled_.size() == Grid(centre_, reach_m_).size());
}

bool CarrierRegion::holds(const Eigen::Vector3d& place_in_body) const {
  if (filled_.empty()) return false;
  const std::uint32_t voxel = Grid(centre_, reach_m_).voxel_of(place_in_body);
  return voxel != kNoVoxel && filled_[voxel] != 0;
}

CarrierRegion find_carrier(const KeyframeClouds& clouds, const std::vector<Keyframe>& keyframes,
                           std::span<const StampedPose> path, const Eigen::Vector3d& lidar_in_body,
                           const CarrierSearchConfig& config, const ProgressSink& progress) {
  if (!(config.reach_m > 0.0) || path.empty()) return {};
  const Grid grid(lidar_in_body, config.reach_m);
  CarrierSearch search(clouds, keyframes, path, grid, config, progress);
  return {lidar_in_body, config.reach_m, search.find()};
}

}  // namespace understory
