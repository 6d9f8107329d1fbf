#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/geometry/voxel_index.h"
#include "understory/registration/icp/icp_map_config.h"
#include "understory/registration/icp/surface.h"

namespace understory::internal {

// The two nearest points that a search found, squared metres; infinite: none. `spot` and `point`
// name the nearest.
struct NearestTwo {
  float best = 0.0F;
  float second = 0.0F;
  std::uint32_t spot = 0;
  std::uint32_t point = 0;  // of ApartPoints, within its block
};

// Points that are all farther than epsilon from each other (P3 section 3.3), in cubes that share a
// surface. The points of a block of 4 x 4 x 4 cubes lie side by side, cube after cube. A coordinate
// of a point is one of 65,536 steps along its cube's edge (4 micrometres of 0.25 m). Directions of
// surfaces have steps of 1/32,767. A cube is named by its block's number times 64 plus its bit,
// until points are removed. Readers may share it between threads while nobody writes.
class ApartPoints {
 public:
  using Place = std::array<int, 3>;

  explicit ApartPoints(const IcpMapConfig& config);

  [[nodiscard]] std::size_t size() const { return size_; }
  // Takes in a point, given from the centre of the cube that it lies in, if it is farther than
  // epsilon from all others. Whether it did.
  bool insert(const Place& cube, const Eigen::Vector3f& from_centre);
  // Removes the cubes whose centre is farther than that from `center` (map frame), metres.
  void remove_beyond(const Eigen::Vector3d& center, double radius_m);
  // Works out the surfaces and covariances near what changed. The same bits for any number of
  // threads.
  void settle();

  // The nearest points among the cubes up to `reach` (0 to 4) from a cube that the place lies in.
  [[nodiscard]] NearestTwo nearest(const Place& cube, const Eigen::Vector3f& from_centre,
                                   int reach) const;
  // A point that was found, map frame.
  [[nodiscard]] Eigen::Vector3d place_of(std::uint32_t spot, std::uint32_t point) const {
    const Block& block = blocks_[spot / kCubes];
    return centre_of(cube_at(block, static_cast<int>(spot % kCubes))) +
           unpacked(block.points[point]).cast<double>();
  }
  // The surface around a cube, and the covariance (m^2; first entry below 0: it tells nothing).
  [[nodiscard]] SurfacePatch patch(std::uint32_t spot) const {
    const Block& block = blocks_[spot / kCubes];
    return block.cubes[rank_of(block, static_cast<int>(spot % kCubes))].patch();
  }
  [[nodiscard]] const Eigen::Matrix3f& covariance(std::uint32_t spot) const {
    const Block& block = blocks_[spot / kCubes];
    return block.covariances[rank_of(block, static_cast<int>(spot % kCubes))];
  }
  // Calls act(point in the map frame, surface) for each point.
  template <typename Act>
  void for_each(const Act& act) const;
  // What it takes in memory, about.
  [[nodiscard]] double bytes() const;

 private:
  static constexpr std::uint32_t kCubes = 64;  // of a block
  static constexpr std::uint32_t kNone = VoxelIndex::kNone;

  struct Packed {
    std::array<std::uint16_t, 3> steps{};  // from the lowest corner of the cube
  };
  struct Cube {
    std::uint32_t end = 0;  // one past its last point; its first is the end of the cube before
    SurfaceKind surface = SurfaceKind::kNothing;
    std::array<std::int16_t, 3> direction{};

    [[nodiscard]] SurfacePatch patch() const {
      return {surface, Eigen::Vector3f(direction[0], direction[1], direction[2]) / kUnit};
    }
    void set(const SurfacePatch& patch);
  };
  static constexpr float kUnit = 32767.0F;
  static constexpr float kSteps = 65536.0F;
  struct Block {
    Place at{};                 // in blocks
    std::uint32_t visit = 0;    // the last one, see touched()
    std::uint64_t present = 0;  // bit x + 4 y + 16 z
    std::uint64_t changed = 0;
    std::vector<Packed> points;  // cube after cube
    std::vector<Cube> cubes;     // those present, by bit
    std::vector<Eigen::Matrix3f> covariances;
  };
  // How far a place is from cubes beside its own, squared, by axis and step (-4 to 4).
  struct Gaps {
    std::array<std::array<float, 9>, 3> squared;
    Gaps(float edge_m, const Eigen::Vector3f& from_centre);
    [[nodiscard]] float to(int x, int y, int z) const {
      return squared[0][static_cast<std::size_t>(x + 4)] +
             squared[1][static_cast<std::size_t>(y + 4)] +
             squared[2][static_cast<std::size_t>(z + 4)];
    }
  };
  // The sums of the neighbourhoods of all cubes of a block; see the source.
  class SumsAround;
  // Sums of the cubes of some blocks, each from its cube's centre.
  struct CubeSums {
    std::vector<std::uint32_t> blocks;
    std::vector<std::uint32_t>
        first;  // of a block's cubes, by number of the block; kNone: not here
    std::vector<SurfaceSums> sums;
  };

  [[nodiscard]] static Place block_of(const Place& cube) {
    return {cube[0] >> 2, cube[1] >> 2, cube[2] >> 2};
  }
  [[nodiscard]] static int bit_of(const Place& cube) {
    return (cube[0] & 3) | (cube[1] & 3) << 2 | (cube[2] & 3) << 4;
  }
  [[nodiscard]] static Place cube_at(const Block& block, int bit) {
    return {4 * block.at[0] + (bit & 3), 4 * block.at[1] + (bit >> 2 & 3),
            4 * block.at[2] + (bit >> 4)};
  }
  [[nodiscard]] Eigen::Vector3d centre_of(const Place& cube) const {
    return config_.cube_m *
           (Eigen::Vector3d(cube[0], cube[1], cube[2]) + Eigen::Vector3d::Constant(0.5));
  }
  // From the centre of its cube.
  [[nodiscard]] Eigen::Vector3f unpacked(const Packed& point) const {
    return step_m_ * Eigen::Vector3f(point.steps[0], point.steps[1], point.steps[2]) + lowest_;
  }
  [[nodiscard]] Packed packed(const Eigen::Vector3f& from_centre) const;
  [[nodiscard]] static std::size_t rank_of(const Block& block, int bit) {
    return static_cast<std::size_t>(std::popcount(block.present & ((std::uint64_t{1} << bit) - 1)));
  }
  [[nodiscard]] static std::uint32_t begin_of(const Block& block, std::size_t rank) {
    return rank == 0 ? 0 : block.cubes[rank - 1].end;
  }
  [[nodiscard]] std::uint32_t find(const Place& block) const;
  Block& find_or_add(const Place& block);
  void mark_changed(Block& block, std::uint64_t cubes);
  void drop_cubes(Block& block, std::uint64_t cubes);
  void drop_block(std::uint32_t number);
  // Calls act(number of the block, its cubes near `cube`, step to the block), the own block first.
  // It does so for each that may have something nearer than `least()`.
  template <typename Least, typename Act>
  void for_each_near(const Place& cube, int reach, const Gaps& gaps, const Least& least,
                     const Act& act) const;
  [[nodiscard]] bool is_apart(const Place& cube, const Eigen::Vector3f& from_centre) const;
  [[nodiscard]] std::vector<std::uint32_t> touched();
  [[nodiscard]] std::array<std::uint32_t, 27> around(const Block& block) const;
  [[nodiscard]] CubeSums sums_of(const std::uint32_t* begin, const std::uint32_t* end) const;
  void work_out(Block& block, const CubeSums& sums, SumsAround& region) const;
  [[nodiscard]] std::uint64_t affected_of(const Block& block,
                                          const std::array<std::uint32_t, 27>& beside) const;
  void gather(const Block& block, const std::array<std::uint32_t, 27>& beside, const CubeSums& sums,
              SumsAround& region) const;

  IcpMapConfig config_;
  float step_m_ = 0.0F;
  Eigen::Vector3f lowest_;          // the middle of the first step, from the centre of a cube
  std::vector<std::uint32_t> due_;  // a cube counts as changed at these numbers of points
  std::size_t size_ = 0;
  std::size_t cubes_ = 0;
  std::vector<Block> blocks_;
  VoxelIndex index_;
  std::vector<Place> changed_;  // blocks
  std::uint32_t visit_ = 0;
};

template <typename Act>
void ApartPoints::for_each(const Act& act) const {
  for (const Block& block : blocks_) {
    std::size_t rank = 0;
    for (std::uint64_t left = block.present; left != 0; left &= left - 1, ++rank) {
      const Eigen::Vector3d centre = centre_of(cube_at(block, std::countr_zero(left)));
      const Cube& cube = block.cubes[rank];
      for (std::uint32_t i = begin_of(block, rank); i < cube.end; ++i)
        act(centre + unpacked(block.points[i]).cast<double>(), cube.patch());
    }
  }
}

}  // namespace understory::internal
