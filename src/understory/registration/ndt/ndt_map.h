#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/voxel_index.h"

namespace understory {

// The cells of a map of normal distributions.
struct NdtMapConfig {
  double cell_size_m = 1.0;  // edge of a cell
  int min_points = 5;        // cells with fewer have no distribution
  // A cell's distribution is worked out again once its points have grown by this share. What a few
  // more among many tell is not worth the time, and grows with the time spent at a place. 0:
  // always.
  double growth = 0.1;
  double sigma_floor_m = 0.03;  // a surface is never taken to be thinner: sensor and pose noise
  double second_axis_weight = 0.25;  // of a cell's second thinnest direction, 0..1
  double volume_weight = 0.03;       // of cells that are neither surface nor line, 0..1
  // Where the lidar is in the frames of the sources, if known; those matched to the map have it in
  // the same place.
  std::optional<Eigen::Vector3d> viewpoint_in_source = std::nullopt;
  // With a viewpoint: where the further lidars of a scan of several are.
  std::vector<Eigen::Vector3d> further_viewpoints_in_source = {};
  // With a viewpoint, what a cell shows lies before its middle, towards the place of view. The
  // distance is this share of the spread along its second axis, 0..2. This holds for a stem, and
  // for what is neither surface nor line. A single view of a cylinder would give 1.36, and cells
  // hold many views. See NdtCell::near_side_m.
  double near_side_line = 1.0;
  double near_side_volume = 0.25;
  // With a viewpoint: what looks like a surface and was seen exactly edge-on is taken for what it
  // is, the trace of one ring.
  bool few_rings = false;
};

// What a cell tells about a point in it. The information of its normal distribution (P4 (40)) is
// kept as rows: information = sum over rows of row * row^T, where row = eigenvector / sigma.
// Directions in which the cell says nothing have no row. One is along a surface or a stem, where
// the spread of the points is that of the cell's box, not of the world. Another is along the ground
// for what one or two rings of the lidar left on it.
struct alignas(64) NdtCell {           // a cache line
  Eigen::Vector3f mean;                // from the centre of the cell, metres
  std::uint32_t count = 0;             // points
  int rows = 0;                        // 0 to 2; 0: the cell matches but does not constrain
  std::array<Eigen::Vector3f, 2> row;  // 1/m, most certain first
  // A lidar sees the near side of a stem or a crown, and the near side goes along with it. Seen
  // along the unit ray u, the points are expected around mean + mean_near_side - near_side_m * u.
  // Here mean_near_side is near_side_m times the mean ray of the cell's own points (map axes). 0
  // for surfaces, and where the viewpoint is unknown.
  float near_side_m = 0.0F;
  Eigen::Vector3f mean_near_side = Eigen::Vector3f::Zero();
};

// Points and which lidar measured each (0: the first one), in parallel; without lidars the first
// one measured all. Refers to what it is made of.
struct NdtSource {
  // NOLINTNEXTLINE(google-explicit-constructor): points alone are a source, too
  NdtSource(const Points& all, std::span<const std::uint8_t> lidar_of = {})
      : points(all), lidars(lidar_of) {}
  const Points& points;
  std::span<const std::uint8_t> lidars;

  [[nodiscard]] std::size_t size() const { return points.size(); }
  [[nodiscard]] std::size_t lidar_of(std::size_t i) const { return lidars.empty() ? 0 : lidars[i]; }
};

// Target of NDT: a grid of normal distributions. Immutable for all who hold it, and shared between
// threads; made by NdtMapBuilder. Cells are addressed by integers: floor(coordinate / cell_size).
class NdtMap {
 public:
  [[nodiscard]] double cell_size() const { return cell_size_; }
  // Where the lidars are in the frame of a source: NdtMapConfig::viewpoint_in_source, or the
  // source's origin, and those of the further lidars.
  [[nodiscard]] const std::vector<Eigen::Vector3d>& viewpoints_in_source() const {
    return viewpoints_in_source_;
  }
  [[nodiscard]] std::size_t size() const { return cells_.size(); }
  [[nodiscard]] bool empty() const { return cells_.empty(); }
  // The cell at integer coordinates, or null.
  [[nodiscard]] const NdtCell* find(int x, int y, int z) const {
    const std::uint32_t found = index_.find(voxel_key(x, y, z));
    return found == VoxelIndex::kNone ? nullptr : &cells_[found];
  }
  // Asks for the memory that find() will look at first.
  void prefetch(int x, int y, int z) const { index_.prefetch(voxel_key(x, y, z)); }
  // All cells with enough points, and their coordinates, in no order that means anything.
  [[nodiscard]] const std::vector<NdtCell>& cells() const { return cells_; }
  [[nodiscard]] const std::vector<std::array<int, 3>>& coordinates() const { return coordinates_; }
  // Mean of a cell in the map frame.
  [[nodiscard]] Eigen::Vector3d mean(std::size_t index) const;

 private:
  friend class NdtMapBuilder;
  double cell_size_ = 1.0;
  std::vector<Eigen::Vector3d> viewpoints_in_source_ = {Eigen::Vector3d::Zero()};
  std::vector<NdtCell> cells_;
  std::vector<std::array<int, 3>> coordinates_;
  VoxelIndex index_;
};
using NdtMapPtr = std::shared_ptr<const NdtMap>;

// Collects points into cells and makes snapshots. Sums are kept from the centre of each cell, so
// that precision does not depend on how far the map reaches. Not thread-safe itself; works in
// parallel inside, with the same bits for any number of threads.
class NdtMapBuilder {
 public:
  explicit NdtMapBuilder(const NdtMapConfig& config);
  ~NdtMapBuilder();
  NdtMapBuilder(NdtMapBuilder&&) noexcept;
  NdtMapBuilder& operator=(NdtMapBuilder&&) noexcept;

  // Adds points given in a source frame (a keyframe's body).
  void insert(const NdtSource& points_in_source, const Pose& map_from_source);
  // Forgets the cells farther than that from the centre (map frame).
  void remove_beyond(const Eigen::Vector3d& center, double radius_m);
  void clear();
  // See TargetBuilder::bytes.
  [[nodiscard]] double bytes() const;
  // The map as it is now. Only what changed since the last snapshot is worked out again; the
  // outcome is the same as if all were. If nobody holds the last snapshot any more, its memory is
  // written on, and the work does not grow with the map. Else it is copied first.
  [[nodiscard]] NdtMapPtr snapshot();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// One cloud of a map and where it is.
struct PlacedCloud {
  const Points* points_in_source = nullptr;
  Pose map_from_source;
};
[[nodiscard]] NdtMapPtr build_ndt_map(std::span<const PlacedCloud> clouds,
                                      const NdtMapConfig& config);

}  // namespace understory
