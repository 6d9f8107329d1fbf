#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/forest/cell_grid.h"
#include "understory/forest/forest_constants.h"

namespace understory {

// A place and its height above the ground, metres.
struct PlaceAbove {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double height_m = 0.0;
};

// The cubic metres of a stand that hold points, as columns above the ground. Places have the frame
// of the inventory. The same whatever the order of points and parts is. Not thread-safe.
class OccupiedSpace {
 public:
  static constexpr int kMetres = 64;  // higher points are left out

  // A point `height_m` above the ground.
  void add(const Eigen::Vector2d& place, double height_m) {
    if (height_m < 0.0 || height_m >= kMetres) return;
    columns_.at(place.x(), place.y()) |= std::uint64_t{1} << static_cast<unsigned>(height_m);
  }
  // What another one holds.
  void add(const OccupiedSpace& other) {
    columns_.merge(other.columns_, [](std::uint64_t& own, std::uint64_t cell) { own |= cell; });
  }
  [[nodiscard]] const CellGrid<std::uint64_t>& columns() const { return columns_; }

 private:
  CellGrid<std::uint64_t> columns_{forest_constants::sight_lines::kCell};
};

// How much of a beam comes through a stand. Safe to use from several threads.
class SightLines {
 public:
  explicit SightLines(const OccupiedSpace& space);

  // Share of a beam from one place to another that nothing in between stops: a fixed share of it
  // goes through each occupied metre. The ground in between lies on a straight line. The last metre
  // at both ends does not count.
  [[nodiscard]] double clear_share(const PlaceAbove& from, const PlaceAbove& to) const;
  // How well a place is seen from others: the sum of their clear shares over the squared distance,
  // 1 for a free view from 10 m. Beams spread, so returns are in proportion to it.
  [[nodiscard]] double view_of(const PlaceAbove& place, const std::vector<PlaceAbove>& from) const;

 private:
  [[nodiscard]] bool holds(const Eigen::Vector2d& place, double height_m) const;

  CellGrid<std::uint64_t>::Bounds bounds_;
  std::vector<std::uint64_t> columns_;  // row by row
};

}  // namespace understory
