#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "understory/forest/ground_area.h"
#include "understory/util/progress.h"

namespace understory {

// A tree as the search for its points sees it: the centre line of its stem, and how far it is
// known.
struct OwnerTree {
  std::vector<Eigen::Vector2d> centres;  // every decimetre from the ground upwards, metres
  double radius_m = 0.0;                 // at breast height
  double seen_to_m = 0.0;                // up to here the centre line was measured
  double height_m = 0.0;                 // NaN if unknown
};

// Where the centre line of a tree is at a height; beyond its ends it goes on upright.
[[nodiscard]] Eigen::Vector2d centre_at(const OwnerTree& tree, double height_m);

// Small cubes that hold points, each with the tree that it hangs together with.
class TreeOwners {
 public:
  static constexpr std::int32_t kNobody = -1;

  // A cube: its middle, metres, height above the ground.
  struct Voxel {
    Eigen::Vector2d place = Eigen::Vector2d::Zero();
    double height_m = 0.0;
    std::int32_t owner = kNobody;
  };

  // Points in the frame of the trees; the height is that above the ground below the point. Those
  // more than 200 km from its origin are left out.
  void add(const Eigen::Vector2d& place, double height_m);

  // Gives each cube to the tree whose stem is nearest along a way through cubes that hold points
  // (Dijkstra from all stems at once). Sideways and downwards ways count more than upwards ones.
  // Above the measured part of a stem, ways begin at its axis too, at a cost that grows upwards.
  // Gaps of up to three cubes are crossed where no way leads. Nothing far from all trees has an
  // owner, nor what stands beside a stem near the ground. Deterministic. Polls `progress`.
  void find(const std::vector<OwnerTree>& trees, const ProgressSink& progress = {});

  // Number of the tree that a point belongs to, kNobody if none. After `find`.
  [[nodiscard]] std::int32_t owner(const Eigen::Vector2d& place, double height_m) const;

  // For clouds in tiles, where each holds the cubes whose lower corner lies in it.
  // The lower corner of the cube that holds a place.
  [[nodiscard]] static Eigen::Vector2d corner_of(const Eigen::Vector2d& place);
  // The cubes by number, each once; empties this.
  [[nodiscard]] std::vector<std::uint64_t> take_cubes();
  // Adds those of the cubes whose lower corner lies in the area.
  void add_cubes(const std::vector<std::uint64_t>& cubes, const GroundArea& area);
  // The cubes of an area and their owners, after `find`.
  [[nodiscard]] std::pair<std::vector<std::uint64_t>, std::vector<std::int32_t>> owned_in(
      const GroundArea& area) const;
  // The same again as a list of owners.
  [[nodiscard]] static TreeOwners of_cubes(std::vector<std::uint64_t> cubes,
                                           std::vector<std::int32_t> owners);

  [[nodiscard]] std::size_t size() const { return cubes_.size(); }
  [[nodiscard]] Voxel voxel(std::size_t i) const;

 private:
  void compact();

  std::vector<std::uint64_t> cubes_;  // sorted, each once, after `find`
  std::vector<std::int32_t> owners_;
  std::size_t limit_ = 4'000'000;
};

}  // namespace understory
