#include "understory/forest/trees/thin_coverage.h"

#include <algorithm>

#include "understory/forest/forest_constants.h"

namespace understory {

using namespace forest_constants::thin_coverage;

CoverageGrid::CoverageGrid() : counts_(kCell) {}

void CoverageGrid::add(const CoverageGrid& other) {
  counts_.merge(other.counts_, [](std::uint32_t& own, std::uint32_t cell) { own += cell; });
}

ThinCoverage CoverageGrid::thin() const {
  ThinCoverage thin;
  thin.cell_m = kCell;
  std::size_t cells = 0;
  counts_.for_each([&](int column, int row, std::uint32_t count) {
    if (count == 0) return;
    ++cells;
    if (count < kFewPerM2 * kCell * kCell) thin.corners.emplace_back(column * kCell, row * kCell);
  });
  std::sort(thin.corners.begin(), thin.corners.end(),
            [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
              return a.y() < b.y() || (a.y() == b.y() && a.x() < b.x());
            });
  if (cells > 0) thin.share = static_cast<double>(thin.corners.size()) / static_cast<double>(cells);
  return thin;
}

}  // namespace understory
