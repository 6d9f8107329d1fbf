#pragma once

#include <Eigen/Core>
#include <vector>

namespace understory {

// What lies beside a run of returns.
enum class Side {
  kOpen,    // a free view past it
  kHidden,  // something nearer, which may hide the rest of it
  kRough    // something only a little behind it
};

// What one ring of a lidar, or one level slice of a cloud, got of something narrow that may be a
// stem. Metres; level frame: z up, origin that of the points.
struct StemSection {
  Eigen::Vector2d surface = Eigen::Vector2d::Zero();  // middle of its edges, mean of its depth
  double height_m = 0.0;
  Eigen::Vector2d sight = Eigen::Vector2d::UnitX();  // unit, away from the sensor; level
  double range_m = 0.0;    // level, from the sensor to the surface; 0: seen from all sides
  double width_m = 0.0;    // across the line of sight, as far as returns tell
  double spacing_m = 0.0;  // between neighbouring returns
  Side left = Side::kOpen;
  Side right = Side::kOpen;
  int returns = 0;
  int level = 0;      // ring or slice, from the lowest up
  float t_ns = 0.0F;  // mean time of its returns since the frame's stamp
};

// What a level of the frame says about a place through which a stem would have to pass.
enum class Sight {
  kHit,     // something is there, narrow or not
  kPassed,  // a beam went past or no return came back
  kHidden,  // something nearer stands before it
  kUnknown  // the level has no beam there
};

// The sections of a frame, level by level, and what the levels saw between them.
class SectionView {
 public:
  virtual ~SectionView() = default;
  // Ordered by level.
  [[nodiscard]] virtual const std::vector<StemSection>& sections() const = 0;
  [[nodiscard]] virtual int levels() const = 0;
  // Where `level` meets an upright line through a place: metres above the origin.
  [[nodiscard]] virtual double height_at(int level, const Eigen::Vector2d& place) const = 0;
  // What `level` saw of that line within `half_width_m`.
  [[nodiscard]] virtual Sight look(int level, const Eigen::Vector2d& place,
                                   double half_width_m) const = 0;
  [[nodiscard]] virtual double range_sd_m() const = 0;  // noise along the beam
};

}  // namespace understory
