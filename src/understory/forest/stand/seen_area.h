#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/forest/cell_grid.h"
#include "understory/forest/stand_constants.h"
#include "understory/geometry/plane/plot_shape.h"

namespace understory {

// Where returns reached the ground or the layer of the stems, gathered in one run through a cloud.
class SeenCells {
 public:
  // `place`: relative to the origin of the inventory; `height_m` above the ground, at most that of
  // the highest slice.
  void add(const Eigen::Vector2d& place, double height_m) {
    if (height_m < forest_constants::seen_area::kLowest) return;
    std::uint8_t& count = cells_.at(place.x(), place.y());
    if (count < 255) ++count;
  }
  // What another one counted.
  void add(const SeenCells& other) {
    cells_.merge(other.cells_, [](std::uint8_t& own, std::uint8_t cell) {
      own = static_cast<std::uint8_t>(std::min(255, own + cell));
    });
  }
  [[nodiscard]] const CellGrid<std::uint8_t>& cells() const { return cells_; }

 private:
  CellGrid<std::uint8_t> cells_{forest_constants::seen_area::kCell};
};

// A stem as it hides what is behind it, metres.
struct StemDisc {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

// From where it was looked: places along the path, and how far stems are found from it. Without
// places only the returns tell what was seen.
struct SeenFrom {
  std::vector<Eigen::Vector2d> path;
  double reach_m = 0.0;
};

// The area in which stems could be seen, as cells in the frame of the stand. A tree counts for a
// figure by hectare if the cell of its foot was seen, and the same cells are the denominator. What
// is hidden behind stems is in neither. The figure then has no bias where trees stand independently
// of each other (Campbell and Mecke's formula).
struct VisibleArea {
  double x0 = 0.0;  // western edge, metres
  double y0 = 0.0;  // southern edge
  double cell_m = forest_constants::seen_area::kCell;
  int columns = 0;
  int rows = 0;
  // Halves of a cell that were seen, row by row: 0, 1 or 2; kBorder where a cell at the border was
  // seen and none of it counts.
  std::vector<std::uint8_t> halves;
  static constexpr std::uint8_t kBorder = 3;

  [[nodiscard]] bool empty() const { return halves.empty(); }
  [[nodiscard]] bool seen(const Eigen::Vector2d& point) const;
  [[nodiscard]] double area_m2() const;
  // What was seen of a plot; of one without rings it is everything.
  [[nodiscard]] double area_in_m2(const PlotShape& plot) const;
};

// Cells with returns, with the gaps filled that chance leaves at their density. Of them those with
// the density that stems need. Where a path is given, those of them in reach and in a straight line
// of sight from it, past all `stems`. At the border of the returns half of a cell counts for each
// side, as the true border lies anywhere in it. `path`, `stems` and cells: relative to `origin`.
// Deterministic for any number of threads.
[[nodiscard]] VisibleArea find_seen_area(const SeenCells& cells, const Eigen::Vector2d& origin,
                                         const std::vector<StemDisc>& stems, const SeenFrom& from);

}  // namespace understory
