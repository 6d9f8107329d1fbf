#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "understory/features/stem_section.h"
#include "understory/geometry/points.h"

namespace understory {

// A cloud from all sides (a map) as level slices: what hangs together in a slice and is narrow is a
// section. The size of the cells in which points hang together follows the spacing of the points.
// Thread-safe once made.
class SliceView : public SectionView {
 public:
  // Points in the level frame.
  explicit SliceView(const Points& points);

  [[nodiscard]] const std::vector<StemSection>& sections() const override { return sections_; }
  [[nodiscard]] int levels() const override { return static_cast<int>(cells_.size()); }
  [[nodiscard]] double height_at(int level, const Eigen::Vector2d& place) const override;
  [[nodiscard]] Sight look(int level, const Eigen::Vector2d& place,
                           double half_width_m) const override;
  [[nodiscard]] double range_sd_m() const override { return 0.01; }
  [[nodiscard]] double spacing_m() const { return spacing_m_; }

 private:
  using Cells = std::unordered_map<std::int64_t, std::vector<std::uint32_t>>;
  [[nodiscard]] std::int64_t key(double x, double y) const;
  void calibrate(const Points& points);
  void gather(int level, const Points& points);
  void add_section(int level, const Points& points, const std::vector<std::uint32_t>& members,
                   const Cells& cells);
  [[nodiscard]] Side neighbourhood(const Cells& cells, const Eigen::Vector2d& centre, double from_m,
                                   double to_m) const;

  double spacing_m_ = 0.02;
  double cell_m_ = 0.06;
  double low_m_ = 0.0;
  std::vector<Cells> cells_;  // of each level, the points in each occupied cell
  std::vector<StemSection> sections_;
};

}  // namespace understory
