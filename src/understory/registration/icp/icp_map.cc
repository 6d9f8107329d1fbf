#include "understory/registration/icp/icp_map.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "understory/geometry/voxel_key.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

// The surface of a point is that of the points up to so many cubes away.
constexpr int kSurroundings = 2;

std::uint64_t key_of(const std::array<int, 3>& cube) {
  return voxel_key(cube[0], cube[1], cube[2]);
}

// The cube that a point lies in, and where it is from the cube's centre.
struct InCube {
  std::array<int, 3> at{};
  Eigen::Vector3f from_centre;
};

InCube locate(const Eigen::Vector3d& point, double cube_m) {
  InCube located;
  for (int k = 0; k < 3; ++k) {
    const double scaled = point[k] / cube_m;
    const double whole = std::floor(scaled);
    located.at[static_cast<std::size_t>(k)] = static_cast<int>(whole);
    located.from_centre[k] = static_cast<float>((scaled - whole - 0.5) * cube_m);
  }
  return located;
}

}  // namespace

internal::NearestTwo IcpMap::look_around(const std::array<int, 3>& cube,
                                         const Eigen::Vector3f& from_centre, int reach) const {
  const auto edge = static_cast<float>(cube_m_);
  constexpr float kNone = std::numeric_limits<float>::infinity();
  internal::NearestTwo found{kNone, kNone, 0, 0};
  blocks_.for_each_near(cube, reach, [&](std::uint32_t spot, int x, int y, int z) {
    const Eigen::Vector3f step(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
    const float squared = (from_centre - edge * step - spots_[spot].from_centre).squaredNorm();
    if (squared < found.best) {
      found = {squared, found.best, spot, 0};
    } else {
      found.second = std::min(found.second, squared);
    }
  });
  return found;
}

bool IcpMap::nearest(const Eigen::Vector3d& at, double max_distance_m, IcpPair& pair,
                     Known& known) const {
  if (!(known.slack_m > 0.0 &&
        (at - known.searched_at).squaredNorm() < known.slack_m * known.slack_m)) {
    const InCube located = locate(at, cube_m_);
    const int reach =
        std::min(kMaxReach, static_cast<int>(std::ceil(max_distance_m / cube_m_ - 1e-9)));
    // What lies within a cube's edge is among the cubes beside the own one.
    const auto search = [&](int cubes) {
      return apart_ ? apart_->nearest(located.at, located.from_centre, cubes)
                    : look_around(located.at, located.from_centre, cubes);
    };
    internal::NearestTwo found = search(1);
    double sure_m = cube_m_;
    if (reach > 1 && static_cast<double>(found.best) > sure_m * sure_m) {
      found = search(reach);
      sure_m = reach * cube_m_;
    }
    known.slack_m = 0.0;
    if (!(static_cast<double>(found.best) <= max_distance_m * max_distance_m)) return false;
    const double others_m = std::min(sure_m, std::sqrt(static_cast<double>(found.second)));
    // A tenth of a millimetre for what rounding does to the squares.
    known = {at, 0.5 * (others_m - std::sqrt(static_cast<double>(found.best))) - 1e-4, found.spot,
             found.point};
  }
  if (apart_) {
    pair.offset = at - apart_->place_of(known.spot, known.point);
    pair.patch = apart_->patch(known.spot);
  } else {
    const Spot& spot = spots_[known.spot];
    pair.offset = at - centre_of(spot.at) - spot.from_centre.cast<double>();
    pair.patch = spot.patch;
  }
  pair.squared_m2 = static_cast<float>(pair.offset.squaredNorm());
  return static_cast<double>(pair.squared_m2) <= max_distance_m * max_distance_m;
}

IcpMapBuilder::IcpMapBuilder(const IcpMapConfig& config) : config_(config) {
  UNDERSTORY_CHECK(config.cube_m > 0.0 && config.epsilon_m <= config.cube_m);
  clear();
}

void IcpMapBuilder::clear() {
  cubes_.clear();
  index_.clear();
  due_.clear();
  map_ = std::make_shared<IcpMap>();
  map_->cube_m_ = config_.cube_m;
  if (config_.epsilon_m > 0.0) map_->apart_.emplace(config_);
}

void IcpMapBuilder::insert(const Points& points_in_source, const Pose& map_from_source) {
  std::vector<InCube> located(points_in_source.size());
  parallel_for(located.size(), 4096, [&](std::size_t i) {
    located[i] = locate(map_from_source * points_in_source[i].cast<double>(), config_.cube_m);
  });
  if (map_->apart_) {
    own_map();
    for (const InCube& point : located)
      map_->apart_->insert(point.at, point.from_centre);
    return;
  }
  for (const InCube& point : located)
    add(point.at, point.from_centre);
}

void IcpMapBuilder::add(const Place& at, const Eigen::Vector3f& from_centre) {
  const std::uint64_t key = key_of(at);
  std::uint32_t number = index_.find(key);
  if (number == VoxelIndex::kNone) {
    number = static_cast<std::uint32_t>(cubes_.size());
    index_.set(key, number);
    cubes_.emplace_back().at = at;
  }
  Cube& cube = cubes_[number];
  for (int k = 0; k < 3; ++k)
    cube.sum[k] += from_centre[k];
  cube.count += 1.0F;
  if (cube.count < cube.due) return;
  cube.due = std::numeric_limits<float>::infinity();  // once is enough
  due_.push_back(number);
}

// Makes the map one that nobody else holds.
void IcpMapBuilder::own_map() {
  if (map_.use_count() > 1) {
    map_ = std::make_shared<IcpMap>(*map_);
  } else {
    // What its other holders read is over.
    std::atomic_thread_fence(std::memory_order_acquire);
  }
}

// Takes the means that are due into the map.
void IcpMapBuilder::settle_due() {
  own_map();
  const std::size_t known = map_->spots_.size();
  map_->spots_.resize(cubes_.size());
  if (config_.covariances) map_->covariances_.resize(cubes_.size());
  for (const std::uint32_t number : due_) {
    Cube& cube = cubes_[number];
    IcpMap::Spot& spot = map_->spots_[number];
    if (number >= known) {
      spot.at = cube.at;
      map_->blocks_.set(cube.at, number);
    }
    const Eigen::Vector3f mean =
        Eigen::Vector3f(cube.sum[0], cube.sum[1], cube.sum[2]) / cube.count;
    const bool moved = (mean - spot.from_centre).norm() >= static_cast<float>(config_.moved_m);
    if (number >= known || moved) map_->blocks_.mark_changed(cube.at);
    spot.from_centre = mean;
    cube.due =
        std::max(cube.count + 1.0F, (1.0F + static_cast<float>(config_.growth)) * cube.count);
  }
  due_.clear();
}

// The last cube takes the place of the one removed.
void IcpMapBuilder::remove(std::uint32_t cube) {
  const Place at = cubes_[cube].at;
  map_->blocks_.mark_changed(at);
  map_->blocks_.erase(at);
  index_.erase(key_of(at));
  const auto last = static_cast<std::uint32_t>(cubes_.size() - 1);
  if (cube != last) {
    cubes_[cube] = cubes_[last];
    map_->spots_[cube] = map_->spots_[last];
    if (config_.covariances) map_->covariances_[cube] = map_->covariances_[last];
    index_.set(key_of(cubes_[cube].at), cube);
    map_->blocks_.set(cubes_[cube].at, cube);
  }
  cubes_.pop_back();
  map_->spots_.pop_back();
  if (config_.covariances) map_->covariances_.pop_back();
}

void IcpMapBuilder::remove_beyond(const Eigen::Vector3d& center, double radius_m) {
  if (map_->apart_) {
    own_map();
    return map_->apart_->remove_beyond(center, radius_m);
  }
  settle_due();
  for (std::uint32_t c = 0; c < cubes_.size();) {
    if ((map_->centre_of(cubes_[c].at) - center).squaredNorm() > radius_m * radius_m) {
      remove(c);  // another one is here now
    } else {
      ++c;
    }
  }
}

double IcpMapBuilder::bytes() const {
  if (map_->apart_) return map_->apart_->bytes();
  const auto cubes = static_cast<double>(cubes_.size());
  double spot = sizeof(Cube) + sizeof(IcpMap::Spot);
  if (config_.covariances) spot += sizeof(Eigen::Matrix3f);
  return cubes * (internal::kArraySlack * spot + internal::kIndexBytes) + map_->blocks_.bytes();
}

SurfaceSums IcpMapBuilder::sums_around(std::uint32_t cube) const {
  const auto edge = static_cast<float>(config_.cube_m);
  SurfaceSums sums;
  map_->blocks_.for_each_near(
      map_->spots_[cube].at, kSurroundings, [&](std::uint32_t near, int x, int y, int z) {
        const Eigen::Vector3f step(static_cast<float>(x), static_cast<float>(y),
                                   static_cast<float>(z));
        sums.add(edge * step + map_->spots_[near].from_centre);
      });
  return sums;
}

// The surface and the covariance around a cube.
void IcpMapBuilder::work_out(std::uint32_t cube) {
  IcpMap::Spot& spot = map_->spots_[cube];
  if (!config_.planes) spot.patch = {SurfaceKind::kPoint, Eigen::Vector3f::Zero()};
  if (!config_.planes && !config_.covariances) return;
  const SurfaceSums sums = sums_around(cube);
  if (config_.planes) spot.patch = surface_of(sums, config_.max_planarity);
  if (config_.covariances)
    map_->covariances_[cube] = covariance_of(sums).value_or(Eigen::Matrix3f::Constant(-1.0F));
}

IcpMapPtr IcpMapBuilder::snapshot() {
  if (map_->apart_) {
    own_map();
    map_->apart_->settle();
    return map_;
  }
  settle_due();
  std::vector<std::uint32_t> affected;
  map_->blocks_.for_each_affected([](std::uint32_t) { return kSurroundings; },
                                  [&](std::uint32_t cube) { affected.push_back(cube); });
  map_->blocks_.forget_changes();
  parallel_for(affected.size(), 256, [&](std::size_t i) { work_out(affected[i]); });
  return map_;
}

}  // namespace understory
