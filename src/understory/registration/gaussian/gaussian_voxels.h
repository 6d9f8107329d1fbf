#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/voxel_index.h"

namespace understory {

// A grid of Gaussians.
struct GaussianVoxelsConfig {
  double voxel_m = 1.0;  // edge
  int min_points = 1;    // voxels with fewer have no Gaussian
  // The covariance of a voxel is the mean of those of its points (VGICP, Koide et al. 2021, (13));
  // false: that of the points themselves, P4 (40).
  bool of_surfaces = false;
};

// The Gaussian of one voxel.
struct GaussianVoxel {
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();        // from the centre of the voxel, metres
  Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();  // axes of the map, m^2
  float count = 0.0F;                                    // points; 0: too few for a Gaussian
  bool tells = false;  // false: the trace of a ring on the ground, which constrains nothing
};

// Target of VGICP and of NDT from distribution to distribution. Immutable for all who hold it, and
// shared between threads; made by GaussianVoxelsBuilder.
class GaussianVoxels {
 public:
  // The voxel of a point and, if `faces`, those that share a face with it: the one whose mean is
  // nearest. Null if none has a Gaussian. `offset`: of the point from that mean.
  [[nodiscard]] const GaussianVoxel* find(const Eigen::Vector3d& at, bool faces,
                                          Eigen::Vector3d& offset) const;
  [[nodiscard]] std::size_t size() const { return voxels_.size(); }
  [[nodiscard]] double voxel_m() const { return voxel_m_; }
  // Calls act(mean in the map frame, voxel) for each Gaussian, in the order in which voxels came.
  template <typename Act>
  void for_each(const Act& act) const {
    for (std::size_t i = 0; i < voxels_.size(); ++i) {
      if (voxels_[i].count > 0.0F)
        act(centre_of(places_[i]) + voxels_[i].mean.cast<double>(), voxels_[i]);
    }
  }

 private:
  friend class GaussianVoxelsBuilder;
  using Place = std::array<int, 3>;
  [[nodiscard]] Eigen::Vector3d centre_of(const Place& at) const {
    return voxel_m_ * (Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d::Constant(0.5));
  }

  double voxel_m_ = 1.0;
  std::vector<GaussianVoxel> voxels_;
  std::vector<Place> places_;
  VoxelIndex index_;
};
using GaussianVoxelsPtr = std::shared_ptr<const GaussianVoxels>;

// Collects points into voxels and makes snapshots. Not thread-safe itself; works in parallel
// inside, with the same bits for any number of threads.
class GaussianVoxelsBuilder {
 public:
  explicit GaussianVoxelsBuilder(const GaussianVoxelsConfig& config);

  // Adds points given in a source frame. `covariances`: of each point, axes of the source, m^2;
  // only of_surfaces asks for them.
  void insert(const Points& points_in_source, const std::vector<Eigen::Matrix3f>& covariances,
              const Pose& map_from_source);
  // Forgets the voxels farther than that from the centre (map frame).
  void remove_beyond(const Eigen::Vector3d& center, double radius_m);
  void clear();
  // See TargetBuilder::bytes.
  [[nodiscard]] double bytes() const;
  // The grid as it is now. If nobody holds the last snapshot any more, its memory is written on.
  [[nodiscard]] GaussianVoxelsPtr snapshot();

 private:
  struct Sums {
    float count = 0.0F;
    bool changed = false;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();  // from the centre
    Eigen::Matrix3f products = Eigen::Matrix3f::Zero();
  };
  std::uint32_t voxel_at(const GaussianVoxels::Place& at);
  void own_grid();
  void settle(std::uint32_t voxel);
  void remove(std::uint32_t voxel);

  GaussianVoxelsConfig config_;
  std::vector<Sums> sums_;  // of the voxels of the grid, in their order
  std::vector<std::uint32_t> changed_;
  std::shared_ptr<GaussianVoxels> grid_;
};

}  // namespace understory
