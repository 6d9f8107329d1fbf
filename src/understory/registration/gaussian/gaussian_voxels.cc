#include "understory/registration/gaussian/gaussian_voxels.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/geometry/voxel_key.h"
#include "understory/registration/cell_blocks.h"
#include "understory/registration/icp/surface.h"
#include "understory/registration/registration_constants.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace registration_constants::gaussian_voxels;

std::array<int, 3> voxel_of(const Eigen::Vector3d& point, double voxel_m) {
  std::array<int, 3> at{};
  for (int k = 0; k < 3; ++k)
    at[static_cast<std::size_t>(k)] = static_cast<int>(std::floor(point[k] / voxel_m));
  return at;
}

std::uint64_t voxel_key_of(const std::array<int, 3>& at) {
  return voxel_key(at[0], at[1], at[2]);
}

// Along a surface or a pole the spread of the points is that of the voxel's box and of the pattern
// of the scan. It is widened, so that it does not hold the pose where it is.
Eigen::Matrix3f widened_along(const Eigen::Matrix3f& covariance) {
  SymmetricEigen3 eigen = fast_symmetric_eigen(covariance.cast<double>());
  const bool plane = eigen.values[0] < kPlaneRatio * eigen.values[1];
  const bool line = eigen.values[1] < kLineRatio * eigen.values[2];
  if (!plane && !line) return covariance;
  for (int k = line ? 2 : 1; k < 3; ++k)
    eigen.values[k] = std::max(eigen.values[k], kAlong * kAlong);
  return (eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose()).cast<float>();
}

// The voxel itself, then those that share a face with it.
constexpr std::array<std::array<int, 3>, 7> kFaces = {
    {{0, 0, 0}, {-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}}};

}  // namespace

const GaussianVoxel* GaussianVoxels::find(const Eigen::Vector3d& at, bool faces,
                                          Eigen::Vector3d& offset) const {
  const Place own = voxel_of(at, voxel_m_);
  const GaussianVoxel* best = nullptr;
  double best_squared = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < (faces ? kFaces.size() : 1); ++k) {
    if (k > 0) {  // nothing beyond a face lies nearer than the face
      const std::size_t axis = (k - 1) / 2;
      const double in_voxel = at[static_cast<Eigen::Index>(axis)] - voxel_m_ * own[axis];
      const double to_face = k % 2 == 1 ? in_voxel : voxel_m_ - in_voxel;
      if (to_face * to_face >= best_squared) continue;
    }
    const Place place = {own[0] + kFaces[k][0], own[1] + kFaces[k][1], own[2] + kFaces[k][2]};
    const std::uint32_t found = index_.find(voxel_key_of(place));
    if (found == VoxelIndex::kNone || !(voxels_[found].count > 0.0F)) continue;
    const Eigen::Vector3d away = at - centre_of(place) - voxels_[found].mean.cast<double>();
    if (away.squaredNorm() >= best_squared) continue;
    best_squared = away.squaredNorm();
    best = &voxels_[found];
    offset = away;
  }
  return best;
}

GaussianVoxelsBuilder::GaussianVoxelsBuilder(const GaussianVoxelsConfig& config) : config_(config) {
  UNDERSTORY_CHECK(config.voxel_m > 0.0);
  clear();
}

void GaussianVoxelsBuilder::clear() {
  sums_.clear();
  changed_.clear();
  grid_ = std::make_shared<GaussianVoxels>();
  grid_->voxel_m_ = config_.voxel_m;
}

double GaussianVoxelsBuilder::bytes() const {
  constexpr double kVoxel = sizeof(Sums) + sizeof(GaussianVoxel) + sizeof(GaussianVoxels::Place);
  return static_cast<double>(sums_.size()) *
         (internal::kArraySlack * kVoxel + internal::kIndexBytes);
}

// Makes the grid one that nobody else holds.
void GaussianVoxelsBuilder::own_grid() {
  if (grid_.use_count() > 1) {
    grid_ = std::make_shared<GaussianVoxels>(*grid_);
  } else {
    // What its other holders read is over.
    std::atomic_thread_fence(std::memory_order_acquire);
  }
}

std::uint32_t GaussianVoxelsBuilder::voxel_at(const GaussianVoxels::Place& at) {
  const std::uint64_t key = voxel_key_of(at);
  const std::uint32_t found = grid_->index_.find(key);
  if (found != VoxelIndex::kNone) return found;
  const auto number = static_cast<std::uint32_t>(sums_.size());
  grid_->index_.set(key, number);
  grid_->voxels_.emplace_back();
  grid_->places_.push_back(at);
  sums_.emplace_back();
  return number;
}

void GaussianVoxelsBuilder::insert(const Points& points_in_source,
                                   const std::vector<Eigen::Matrix3f>& covariances,
                                   const Pose& map_from_source) {
  UNDERSTORY_CHECK(!config_.of_surfaces || covariances.size() == points_in_source.size());
  own_grid();
  const Eigen::Matrix3f rotation = map_from_source.rotation_matrix().cast<float>();
  std::vector<Eigen::Vector3d> placed(points_in_source.size());
  parallel_for(placed.size(), 4096, [&](std::size_t i) {
    placed[i] = map_from_source * points_in_source[i].cast<double>();
  });
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const GaussianVoxels::Place place = voxel_of(placed[i], config_.voxel_m);
    const std::uint32_t voxel = voxel_at(place);
    Sums& sums = sums_[voxel];
    const Eigen::Vector3f d = (placed[i] - grid_->centre_of(place)).cast<float>();
    sums.count += 1.0F;
    sums.sum += d;
    if (config_.of_surfaces)
      sums.products += rotation * covariances[i] * rotation.transpose();
    else
      sums.products += d * d.transpose();
    if (sums.changed) continue;
    sums.changed = true;
    changed_.push_back(voxel);
  }
}

void GaussianVoxelsBuilder::settle(std::uint32_t voxel) {
  Sums& sums = sums_[voxel];
  GaussianVoxel& known = grid_->voxels_[voxel];
  sums.changed = false;
  if (sums.count < static_cast<float>(config_.min_points)) return;
  known.count = sums.count;
  known.mean = sums.sum / sums.count;
  if (config_.of_surfaces) {
    known.covariance = sums.products / sums.count;
    known.tells = true;
    return;
  }
  const std::optional<Eigen::Matrix3f> covariance =
      covariance_of({static_cast<std::size_t>(sums.count), sums.sum, sums.products});
  known.tells = covariance.has_value();
  if (known.tells) known.covariance = widened_along(*covariance);
}

// The last voxel takes the place of the one removed.
void GaussianVoxelsBuilder::remove(std::uint32_t voxel) {
  grid_->index_.erase(voxel_key_of(grid_->places_[voxel]));
  const auto last = static_cast<std::uint32_t>(sums_.size() - 1);
  if (voxel != last) {
    sums_[voxel] = sums_[last];
    grid_->voxels_[voxel] = grid_->voxels_[last];
    grid_->places_[voxel] = grid_->places_[last];
    grid_->index_.set(voxel_key_of(grid_->places_[voxel]), voxel);
  }
  sums_.pop_back();
  grid_->voxels_.pop_back();
  grid_->places_.pop_back();
}

void GaussianVoxelsBuilder::remove_beyond(const Eigen::Vector3d& center, double radius_m) {
  static_cast<void>(snapshot());  // what changed is known by numbers, which removals change
  own_grid();
  for (std::uint32_t v = 0; v < sums_.size();) {
    if ((grid_->centre_of(grid_->places_[v]) - center).squaredNorm() > radius_m * radius_m) {
      remove(v);  // another one is here now
    } else {
      ++v;
    }
  }
}

GaussianVoxelsPtr GaussianVoxelsBuilder::snapshot() {
  if (!changed_.empty()) own_grid();
  parallel_for(changed_.size(), 256, [&](std::size_t i) { settle(changed_[i]); });
  changed_.clear();
  return grid_;
}

}  // namespace understory
