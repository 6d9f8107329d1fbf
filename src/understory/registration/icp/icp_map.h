#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/voxel_index.h"
#include "understory/registration/cell_blocks.h"
#include "understory/registration/icp/apart_points.h"
#include "understory/registration/icp/icp_map_config.h"
#include "understory/registration/icp/surface.h"

namespace understory {

// Target of ICP made of clouds that come one after another: points with the surface around each.
// Immutable for all who hold it, and shared between threads; made by IcpMapBuilder.
class IcpMap {
 public:
  // Distances beyond so many cubes are not searched.
  static constexpr int kMaxReach = 4;

  [[nodiscard]] std::size_t size() const { return apart_ ? apart_->size() : spots_.size(); }
  // What a search found for a point that moves step by step. While it stays within `slack_m` of
  // where it was searched, no other point of the map can be nearer.
  struct Known {
    Eigen::Vector3d searched_at = Eigen::Vector3d::Zero();
    double slack_m = 0.0;
    std::uint32_t spot = 0;   // of the map, for covariance()
    std::uint32_t point = 0;  // see internal::NearestTwo
  };
  // The nearest point within the distance, at most kMaxReach cubes; false if none. `known` is that
  // of the same point and distance before, or new.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& at, double max_distance_m, IcpPair& pair,
                             Known& known) const;
  // The covariance around a point, m^2 (axes of the map); null where it tells nothing. Of a map
  // with IcpMapConfig::covariances.
  [[nodiscard]] const Eigen::Matrix3f* covariance(std::uint32_t spot) const {
    const Eigen::Matrix3f& found = apart_ ? apart_->covariance(spot) : covariances_[spot];
    return found(0, 0) >= 0.0F ? &found : nullptr;
  }
  // Calls act(point in the map frame, surface) for each point, in no order that means anything.
  template <typename Act>
  void for_each(const Act& act) const {
    if (apart_) return apart_->for_each(act);
    for (const Spot& spot : spots_)
      act(centre_of(spot.at) + spot.from_centre.cast<double>(), spot.patch);
  }

 private:
  friend class IcpMapBuilder;
  struct Spot {
    Eigen::Vector3f from_centre;  // of its cube, so that precision is the same everywhere
    SurfacePatch patch;
    std::array<int, 3> at{};  // cube
  };
  [[nodiscard]] Eigen::Vector3d centre_of(const std::array<int, 3>& cube) const {
    return cube_m_ * (Eigen::Vector3d(cube[0], cube[1], cube[2]) + Eigen::Vector3d::Constant(0.5));
  }
  [[nodiscard]] internal::NearestTwo look_around(const std::array<int, 3>& cube,
                                                 const Eigen::Vector3f& from_centre,
                                                 int reach) const;

  double cube_m_ = 1.0;
  std::vector<Spot> spots_;
  std::vector<Eigen::Matrix3f> covariances_;  // of the spots, if wanted; first entry -1: nothing
  internal::CellBlocks blocks_;
  std::optional<internal::ApartPoints> apart_;  // all of it, with epsilon_m; the others are empty
};
using IcpMapPtr = std::shared_ptr<const IcpMap>;

// Collects points into cubes and makes snapshots. Not thread-safe itself; works in parallel inside,
// with the same bits for any number of threads.
class IcpMapBuilder {
 public:
  explicit IcpMapBuilder(const IcpMapConfig& config);

  // Adds points given in a source frame (a keyframe's body).
  void insert(const Points& points_in_source, const Pose& map_from_source);
  // Forgets the cubes farther than that from the centre (map frame).
  void remove_beyond(const Eigen::Vector3d& center, double radius_m);
  void clear();
  // See TargetBuilder::bytes.
  [[nodiscard]] double bytes() const;
  // The map as it is now; only the surfaces near what changed are worked out again. If nobody holds
  // the last snapshot any more, its memory is written on; else it is copied first.
  [[nodiscard]] IcpMapPtr snapshot();

 private:
  using Place = std::array<int, 3>;
  struct Cube {
    float sum[3] = {0.0F, 0.0F, 0.0F};  // from its centre
    float count = 0.0F;
    float due = 1.0F;  // its mean is taken at so many points
    Place at{};
  };
  void add(const Place& at, const Eigen::Vector3f& from_centre);
  void own_map();
  void settle_due();
  void remove(std::uint32_t cube);
  [[nodiscard]] SurfaceSums sums_around(std::uint32_t cube) const;
  void work_out(std::uint32_t cube);

  IcpMapConfig config_;
  std::vector<Cube> cubes_;  // those in the map first, in its order
  VoxelIndex index_;
  std::vector<std::uint32_t> due_;  // cubes whose mean is to be taken
  std::shared_ptr<IcpMap> map_;
};

}  // namespace understory
