#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "understory/sensor/gnss_fix.h"
#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/sensors/counter_noise.h"

namespace understory {

// Geodetic coordinates (latitude, longitude in degrees, height above the WGS 84 ellipsoid) of a
// point given east, north, up of an origin.
[[nodiscard]] Eigen::Vector3d geodetic_from_enu(const OriginConfig& origin,
                                                const Eigen::Vector3d& point_in_enu);

// The GNSS receiver under trees. It has slow and fast errors correlated in time, both growing with
// the share of the sky that the stand hides. Its height is worse than its plane. It has outages,
// bursts, jumps, and a covariance that promises too much. Where asked, it holds its position while
// it stands, and tells the heading or the position of a second antenna. Fixes come one after
// another.
class SatelliteReceiver {
 public:
  // `path` and `scene` must outlive the receiver.
  SatelliteReceiver(const SiteConfig& config, const CarrierPath& path, const ForestScene& scene,
                    TimeNs start);

  [[nodiscard]] TimeNs next_stamp() const;
  // The next fix, or nothing during an outage.
  std::optional<GnssFix> next();

  // What stands behind the last fix, for tests and reports.
  // Where the site's second antenna gives positions: that of the moment of the last fix.
  [[nodiscard]] const std::optional<GnssFix>& second_fix() const { return second_fix_; }
  [[nodiscard]] double last_cover() const { return cover_; }
  [[nodiscard]] const Eigen::Vector3d& last_error_enu() const { return error_; }

 private:
  void walk(double dt_s);
  [[nodiscard]] bool in_outage(double dt_s, CounterNoise& noise);
  [[nodiscard]] bool is_silent(TimeNs stamp) const;
  [[nodiscard]] Eigen::Vector3d burst(double dt_s);
  void jump(double dt_s);

  [[nodiscard]] bool has_second_positions() const;
  [[nodiscard]] GnssFix second_position(const Pose& world_from_body, const GnssFix& first,
                                        double sd_m) const;
  void walk_heading(double dt_s);
  void tell_heading(const Pose& world_from_body, GnssFix& fix) const;
  [[nodiscard]] Eigen::Vector3d hold(const Eigen::Vector3d& solution, double speed_m_s);

  GnssConfig config_;
  ReceiverHoldConfig hold_;
  OriginConfig origin_;
  const CarrierPath& path_;
  const ForestScene& scene_;
  TimeNs start_;
  std::uint64_t seed_;
  Eigen::Vector3d slow_;  // unit variance
  Eigen::Vector3d fast_;
  Eigen::Vector3d second_slow_;  // what the second antenna does not have in common with the first
  Eigen::Vector3d second_fast_;
  std::optional<GnssFix> second_fix_;
  Eigen::Vector3d error_ = Eigen::Vector3d::Zero();
  double cover_now_ = 0.0;
  double cover_ = 0.0;
  double outage_left_s_ = 0.0;
  Eigen::Vector3d jump_ = Eigen::Vector3d::Zero();
  double burst_s_ = 1.0;
  double burst_left_s_ = 0.0;
  Eigen::Vector3d burst_peak_ = Eigen::Vector3d::Zero();
  double heading_slow_ = 0.0;            // unit variance
  double heading_error_ = 0.0;           // unit variance
  std::optional<Eigen::Vector3d> held_;  // east-north-up, while the carrier stands
  std::int64_t count_ = 0;
};

}  // namespace understory
