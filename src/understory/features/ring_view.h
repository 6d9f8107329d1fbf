#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/features/stem_section.h"
#include "understory/sensor/scan.h"

namespace understory {

// The rings of one scan of a spinning lidar as sections. Thread-safe once made.
class RingView : public SectionView {
 public:
  // `level_from_lidar` turns z up. Returns farther than `max_range_m` are passed over (they still
  // show that a place is free). A point whose entry of `use` is 0 hides what lies behind it and is
  // nothing else; empty: all are used.
  RingView(const Scan& scan, const Eigen::Matrix3d& level_from_lidar, double max_range_m,
           const std::vector<std::uint8_t>& use = {});

  [[nodiscard]] const std::vector<StemSection>& sections() const override { return sections_; }
  [[nodiscard]] int levels() const override { return static_cast<int>(rings_.size()); }
  [[nodiscard]] double height_at(int level, const Eigen::Vector2d& place) const override;
  [[nodiscard]] Sight look(int level, const Eigen::Vector2d& place,
                           double half_width_m) const override;
  [[nodiscard]] double range_sd_m() const override { return range_sd_m_; }
  [[nodiscard]] double step_rad() const { return step_rad_; }
  // All returns that are used, level frame.
  [[nodiscard]] const std::vector<Eigen::Vector3f>& points() const { return points_; }

 private:
  static constexpr std::uint32_t kOnlyHides = 0xffffffffU;
  struct Return {
    float azimuth = 0.0F;     // in the lidar's frame, radians
    float range = 0.0F;       // level in the lidar's frame: from the axis of rotation
    std::uint32_t point = 0;  // of points_, or kOnlyHides
    float t_ns = 0.0F;
    [[nodiscard]] bool only_hides() const { return point == kOnlyHides; }
  };
  struct Ring {
    double slope = 0.0;           // tangent of its elevation
    std::vector<Return> returns;  // by azimuth
  };

  void gather(const Scan& scan, const std::vector<std::uint8_t>& use);
  void calibrate();
  void cut(int level, double max_range_m);
  void add_section(int level, std::size_t begin, std::size_t end);
  [[nodiscard]] bool linked(const Return& a, const Return& b) const;
  [[nodiscard]] Side side(const Ring& ring, std::size_t at, int direction) const;
  [[nodiscard]] bool covered(double azimuth) const;

  Eigen::Matrix3d level_from_lidar_;
  std::vector<Ring> rings_;
  std::vector<Eigen::Vector3f> points_;
  std::vector<StemSection> sections_;
  std::vector<std::uint8_t> covered_;  // per degree: some ring has a return there
  double step_rad_ = 0.0;
  double range_sd_m_ = 0.0;
};

}  // namespace understory
