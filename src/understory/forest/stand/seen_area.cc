#include "understory/forest/stand/seen_area.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "understory/forest/stand_figure_constants.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::seen_area;
using namespace forest_constants::seen_gaps;

// A picture of bytes, 0 beyond its edges.
struct Cells {
  int columns = 0;
  int rows = 0;
  std::vector<std::uint8_t> values;

  Cells(int width, int height)
      : columns(width),
        rows(height),
        values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0) {}
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] std::uint8_t at(int column, int row) const {
    if (column < 0 || row < 0 || column >= columns || row >= rows) return 0;
    return values[index(column, row)];
  }
};

// Sums along a line of cells. Entry c counts the cells before column c - `margin` that hold
// anything. A stretch within `margin` of the line is then a difference of two entries.
void sum_line(const Cells& cells, int row, int margin, std::vector<int>& sums) {
  sums.assign(static_cast<std::size_t>(cells.columns + 2 * margin + 1), 0);
  int held = 0;
  for (int column = -margin; column < cells.columns + margin; ++column) {
    held += cells.at(column, row) != 0 ? 1 : 0;
    sums[static_cast<std::size_t>(column + margin + 1)] = held;
  }
}

// Cells of the disc of `radius` cells around each that holds anything (`grow`), or only those whose
// whole disc is held.
Cells with_disc(const Cells& cells, int radius, bool grow) {
  Cells result(cells.columns, cells.rows);
  std::vector<int> reach;  // of the disc's lines, to each side
  int size = 0;
  for (int dy = -radius; dy <= radius; ++dy) {
    int dx = 0;
    while ((dx + 1) * (dx + 1) + dy * dy <= radius * radius)
      ++dx;
    reach.push_back(dx);
    size += 2 * dx + 1;
  }
  std::vector<std::vector<int>> sums(static_cast<std::size_t>(cells.rows));
  parallel_for(sums.size(), 16, [&](std::size_t line) {
    sum_line(cells, static_cast<int>(line), radius, sums[line]);
  });
  const auto width = static_cast<std::size_t>(cells.columns);
  const auto middle = static_cast<std::size_t>(radius);
  parallel_for(sums.size(), 16, [&](std::size_t line) {
    std::vector<int> held(width, 0);
    for (int dy = -radius; dy <= radius; ++dy) {
      const int row = static_cast<int>(line) + dy;
      if (row < 0 || row >= cells.rows) continue;
      const auto dx = static_cast<std::size_t>(reach[static_cast<std::size_t>(dy + radius)]);
      const int* low = sums[static_cast<std::size_t>(row)].data() + middle - dx;
      const int* high = sums[static_cast<std::size_t>(row)].data() + middle + dx + 1;
      for (std::size_t i = 0; i < width; ++i)
        held[i] += high[i] - low[i];
    }
    std::uint8_t* values = result.values.data() + line * width;
    const int least = grow ? 1 : size;
    for (std::size_t i = 0; i < width; ++i)
      values[i] = held[i] >= least ? 1 : 0;
  });
  return result;
}

// How many cells of the square of kAround cells on each side hold at least `least`: at most 81.
Cells counted_around(const Cells& cells, std::uint8_t least) {
  static_assert((2 * kAround + 1) * (2 * kAround + 1) < 256);
  Cells lines(cells.columns, cells.rows);
  Cells squares(cells.columns, cells.rows);
  parallel_for(static_cast<std::size_t>(cells.rows), 16, [&](std::size_t line) {
    const auto row = static_cast<int>(line);
    for (int column = 0; column < cells.columns; ++column) {
      int sum = 0;
      for (int dx = -kAround; dx <= kAround; ++dx)
        sum += cells.at(column + dx, row) >= least ? 1 : 0;
      lines.values[lines.index(column, row)] = static_cast<std::uint8_t>(sum);
    }
  });
  parallel_for(static_cast<std::size_t>(cells.rows), 16, [&](std::size_t line) {
    const auto row = static_cast<int>(line);
    for (int column = 0; column < cells.columns; ++column) {
      int sum = 0;
      for (int dy = -kAround; dy <= kAround; ++dy)
        sum += lines.at(column, row + dy);
      squares.values[squares.index(column, row)] = static_cast<std::uint8_t>(sum);
    }
  });
  return squares;
}

// How far one sees in each direction from a place: to the far side of the nearest stem. So a stem
// does not hide itself.
class Look {
 public:
  Look(const Eigen::Vector2d& from, const std::vector<StemDisc>& stems, double reach_m)
      : from_(from) {
    free_.fill(std::numeric_limits<double>::infinity());
    for (const StemDisc& stem : stems) {
      const Eigen::Vector2d to = stem.centre - from;
      const double distance = to.norm();
      if (distance > reach_m + stem.radius_m || distance <= stem.radius_m) continue;
      const double half = std::asin(stem.radius_m / distance);
      const double middle = std::atan2(to.y(), to.x());
      // Directions whose middle is hidden.
      const auto first = static_cast<int>(std::ceil(bin_of(middle - half) - 0.5));
      const auto last = static_cast<int>(std::floor(bin_of(middle + half) - 0.5));
      for (int bin = first; bin <= last; ++bin) {
        double& far = free_[static_cast<std::size_t>((bin + 2 * kDirections) % kDirections)];
        far = std::min(far, distance + stem.radius_m);
      }
    }
  }
  [[nodiscard]] bool reaches(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d to = point - from_;
    const auto bin = static_cast<int>(std::floor(bin_of(std::atan2(to.y(), to.x()))));
    return to.norm() <= free_[static_cast<std::size_t>((bin + 2 * kDirections) % kDirections)];
  }
  [[nodiscard]] const Eigen::Vector2d& from() const { return from_; }

 private:
  static double bin_of(double angle) { return angle / (2.0 * M_PI) * kDirections; }
  Eigen::Vector2d from_;
  std::array<double, kDirections> free_{};
};

std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& path) {
  std::vector<Eigen::Vector2d> places;
  for (const Eigen::Vector2d& place : path)
    if (places.empty() || (place - places.back()).norm() >= kStep) places.push_back(place);
  return places;
}

// Leaves those cells of `seen` that are looked at from anywhere. `corner`: of the cells.
void keep_looked_at(const SeenFrom& from, const std::vector<StemDisc>& stems,
                    const Eigen::Vector2d& corner, Cells& seen) {
  Cells looked(seen.columns, seen.rows);
  for (const Eigen::Vector2d& place : thinned(from.path)) {
    const Look look(place, stems, from.reach_m);
    const auto cell_at = [&](double value, double edge) {
      return static_cast<int>(std::floor((value - edge) / kCell));
    };
    const int low = std::max(0, cell_at(place.y() - from.reach_m, corner.y()));
    const int high = std::min(seen.rows - 1, cell_at(place.y() + from.reach_m, corner.y()));
    const int left = std::max(0, cell_at(place.x() - from.reach_m, corner.x()));
    const int right = std::min(seen.columns - 1, cell_at(place.x() + from.reach_m, corner.x()));
    for (int row = low; row <= high; ++row) {
      for (int column = left; column <= right; ++column) {
        const std::size_t cell = seen.index(column, row);
        if (seen.values[cell] == 0 || looked.values[cell] != 0) continue;
        const Eigen::Vector2d middle = corner + kCell * Eigen::Vector2d(column + 0.5, row + 0.5);
        if ((middle - place).squaredNorm() > from.reach_m * from.reach_m) continue;
        if (look.reaches(middle)) looked.values[cell] = 1;
      }
    }
  }
  for (std::size_t i = 0; i < seen.values.size(); ++i)
    seen.values[i] = seen.values[i] != 0 && looked.values[i] != 0 ? 1 : 0;
}

Cells counts_of(const SeenCells& cells, const CellGrid<std::uint8_t>::Bounds& bounds) {
  // Room for what is filled, so that the edge of the picture is none of the returns.
  Cells counts(bounds.columns + 2 * kFillSparse, bounds.rows + 2 * kFillSparse);
  cells.cells().for_each([&](int column, int row, std::uint8_t count) {
    const int c = column - bounds.column0 + kFillSparse;
    const int r = row - bounds.row0 + kFillSparse;
    if (c < 0 || r < 0 || c >= counts.columns || r >= counts.rows) return;
    counts.values[counts.index(c, r)] = count;
  });
  return counts;
}

// Gaps up to twice `radius` filled.
Cells closed(const Cells& cells, int radius) {
  return with_disc(with_disc(cells, radius, true), radius, false);
}

// Empty cells whose four neighbours hold something.
Cells lone_holes(const Cells& counts) {
  Cells holes(counts.columns, counts.rows);
  for (int row = 0; row < counts.rows; ++row) {
    for (int column = 0; column < counts.columns; ++column) {
      const bool lone = counts.at(column, row) == 0 && counts.at(column - 1, row) != 0 &&
                        counts.at(column + 1, row) != 0 && counts.at(column, row - 1) != 0 &&
                        counts.at(column, row + 1) != 0;
      holes.values[holes.index(column, row)] = lone ? 1 : 0;
    }
  }
  return holes;
}

// Cells with returns, and the gaps between them that are no shadows: the denser the returns, the
// smaller a gap that chance leaves.
Cells reached_of(const Cells& counts, const Cells& sparse) {
  const Cells single = lone_holes(counts);
  const Cells narrow = closed(counts, kFillDense);
  const Cells wide = closed(counts, kFill);
  const Cells all = counted_around(counts, 1);
  const std::array<std::pair<std::uint8_t, const Cells*>, 3> fillings = {
      std::pair{kNoGaps, &single}, std::pair{kNarrowGaps, &narrow}, std::pair{kNotSparse, &wide}};
  Cells reached = sparse;
  std::vector<char> done(counts.values.size(), 0);
  for (const auto& [least, filled] : fillings) {
    const Cells full = counted_around(counts, least);
    for (std::size_t i = 0; i < reached.values.size(); ++i) {
      if (done[i] != 0 || full.values[i] < kDenseShare * all.values[i] || all.values[i] == 0)
        continue;
      done[i] = 1;
      reached.values[i] = counts.values[i] != 0 || filled->values[i] != 0 ? 1 : 0;
    }
  }
  return reached;
}

// Puts `value` into the cells whose middle is no farther than `beside_m` from the surface of a
// stem. `corner`: of the cells.
void mark_stems(const std::vector<StemDisc>& stems, const Eigen::Vector2d& corner, double beside_m,
                std::uint8_t value, Cells& cells) {
  for (const StemDisc& stem : stems) {
    const double radius = stem.radius_m + beside_m;
    const Eigen::Vector2d low = ((stem.centre - corner).array() - radius) / kCell;
    const Eigen::Vector2d high = ((stem.centre - corner).array() + radius) / kCell;
    for (int row = static_cast<int>(low.y()); row <= static_cast<int>(high.y()); ++row) {
      for (int column = static_cast<int>(low.x()); column <= static_cast<int>(high.x()); ++column) {
        if (column < 0 || row < 0 || column >= cells.columns || row >= cells.rows) continue;
        const Eigen::Vector2d middle = corner + kCell * Eigen::Vector2d(column + 0.5, row + 0.5);
        if ((middle - stem.centre).norm() <= radius) cells.values[cells.index(column, row)] = value;
      }
    }
  }
}

// Share of the cells around that has to hold a return: half, or of a thinned cloud half of its
// median.
double share_needed(const Cells& reached, const Cells& all, const Cells& full) {
  std::array<std::uint64_t, 101> histogram{};
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < reached.values.size(); ++i) {
    if (reached.values[i] == 0 || all.values[i] == 0) continue;
    ++histogram[static_cast<std::size_t>(100 * full.values[i] / all.values[i])];
    ++count;
  }
  std::size_t median = 0;
  for (std::uint64_t below = histogram[0]; 2 * below < count; below += histogram[median])
    ++median;
  return std::clamp(kOfMedian * 0.01 * static_cast<double>(median), kThinnedShare, kDenseShare);
}

// Cells with the density that stems need, of those with returns. The surroundings of stems say
// nothing of it.
Cells dense_of(const Cells& counts, const Cells& reached, const std::vector<StemDisc>& stems,
               const Eigen::Vector2d& corner) {
  Cells open = reached;
  Cells held = counts;
  mark_stems(stems, corner, kBesideStem, 0, open);
  mark_stems(stems, corner, kBesideStem, 0, held);
  const Cells all = counted_around(open, 1);
  const Cells full = counted_around(held, 1);
  const double least = share_needed(reached, all, full);
  Cells dense(counts.columns, counts.rows);
  for (std::size_t i = 0; i < dense.values.size(); ++i) {
    if (reached.values[i] == 0) continue;
    dense.values[i] = full.values[i] >= least * all.values[i] ? 1 : 0;
  }
  return dense;
}

// A cell at the border of the returns loses half for each side that has none. At the border of a
// shadow it does not: a stem there shows although its middle is hidden.
std::uint8_t halves_of(const Cells& wide, int column, int row) {
  const int open = 4 - wide.at(column - 1, row) - wide.at(column + 1, row) -
                   wide.at(column, row - 1) - wide.at(column, row + 1);
  return open >= 2 ? VisibleArea::kBorder : static_cast<std::uint8_t>(2 - open);
}

double halves_that_count(std::uint8_t halves) {
  return halves == VisibleArea::kBorder ? 0.0 : static_cast<double>(halves);
}

}  // namespace

bool VisibleArea::seen(const Eigen::Vector2d& point) const {
  const auto column = static_cast<int>(std::floor((point.x() - x0) / cell_m));
  const auto row = static_cast<int>(std::floor((point.y() - y0) / cell_m));
  if (column < 0 || row < 0 || column >= columns || row >= rows) return false;
  return halves[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                static_cast<std::size_t>(column)] != 0;
}

double VisibleArea::area_m2() const {
  double sum = 0.0;
  for (const std::uint8_t cell : halves)
    sum += halves_that_count(cell);
  return 0.5 * sum * cell_m * cell_m;
}

double VisibleArea::area_in_m2(const PlotShape& plot) const {
  if (plot.rings.empty()) return area_m2();
  // The share of the plot's cells, so that the size of cells does not change its area.
  const Eigen::Vector4d box = plot.box();
  const auto first_row = static_cast<long>(std::floor((box[1] - y0) / cell_m));
  const auto last_row = static_cast<long>(std::floor((box[3] - y0) / cell_m));
  double sum = 0.0;
  std::uint64_t all = 0;
  for (long row = first_row; row <= last_row; ++row) {
    const double y = y0 + (static_cast<double>(row) + 0.5) * cell_m;
    const std::vector<double> crossings = plot.crossings(y);
    for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
      // Cells whose middle lies between the two.
      const auto begin = static_cast<long>(std::ceil((crossings[i] - x0) / cell_m - 0.5));
      const auto end = static_cast<long>(std::ceil((crossings[i + 1] - x0) / cell_m - 0.5));
      all += static_cast<std::uint64_t>(end - begin);
      if (row < 0 || row >= rows) continue;
      for (long column = std::max(0L, begin); column < std::min<long>(columns, end); ++column)
        sum += halves_that_count(
            halves[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                   static_cast<std::size_t>(column)]);
    }
  }
  return all == 0 ? 0.0 : plot.area_m2() * 0.5 * sum / static_cast<double>(all);
}

VisibleArea find_seen_area(const SeenCells& cells, const Eigen::Vector2d& origin,
                           const std::vector<StemDisc>& stems, const SeenFrom& from) {
  constexpr std::uint64_t kMostCells = 64'000'000;  // 4 km2
  constexpr std::uint64_t kStray = 20;
  const auto bounds = cells.cells().bounds(kMostCells, kStray);
  VisibleArea area;
  if (bounds.columns == 0) return area;
  const Cells counts = counts_of(cells, bounds);
  const Eigen::Vector2d corner =
      kCell * Eigen::Vector2d(bounds.column0 - kFillSparse, bounds.row0 - kFillSparse);
  const Cells wide = closed(counts, kFillSparse);
  // With a path the stems themselves tell their shadows.
  Cells reached = from.path.empty() ? reached_of(counts, wide) : wide;
  // No return comes from inside of a stem: its own cells count as reached.
  mark_stems(stems, corner, 0.5 * kCell, 1, reached);
  Cells seen = dense_of(counts, reached, stems, corner);
  area.columns = counts.columns;
  area.rows = counts.rows;
  area.x0 = origin.x() + corner.x();
  area.y0 = origin.y() + corner.y();
  if (!from.path.empty()) keep_looked_at(from, stems, corner, seen);
  area.halves.assign(seen.values.size(), 0);
  for (int row = 0; row < area.rows; ++row) {
    for (int column = 0; column < area.columns; ++column) {
      if (seen.at(column, row) != 0)
        area.halves[seen.index(column, row)] = halves_of(wide, column, row);
    }
  }
  return area;
}

}  // namespace understory
