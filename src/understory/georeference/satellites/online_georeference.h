#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/satellites/fix_covariance.h"
#include "understory/georeference/satellites/receiver_filters.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/georeference/satellites/second_antenna.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Settings of the online georeference.
struct OnlineGeoreferenceConfig {
  FixCovarianceConfig covariance;
  double time_offset_s = 0.0;  // added to the stamps of the fixes
  double interval_s = 1.0;     // fixes of one interval become one pair
  // How far the world's up may be off gravity, one standard deviation about each level axis.
  double tilt_sd_deg = 0.05;
  // The drift of the odometry: standard deviations that grow with the root of the way.
  double drift_deg_per_sqrt_m = 0.003;
  double drift_m_per_sqrt_m = 0.002;
  ReceiverFilterConfig plane;
  ReceiverFilterConfig height;
  SecondAntennaConfig second_antenna;
  double heading_sd_deg = 0.5;  // of a heading whose receiver does not say how good it is
};

// The body on the globe at one scan, by all that was received until then. What is not known is NaN,
// and so is its standard deviation.
struct GlobalPose {
  TimeNs stamp = 0;
  bool known = false;                                                 // latitude and longitude
  bool height_known = false;                                          // above the ellipsoid
  bool heading_known = false;                                         // and with it roll and pitch
  GeodeticPlace place;                                                // of the body's origin
  Eigen::Quaterniond enu_from_body = Eigen::Quaterniond::Identity();  // if the heading is known
  Eigen::Vector3d place_sd_m = Eigen::Vector3d::Zero();               // east, north, up
  // Turns about the east, the north and the up axis.
  Eigen::Vector3d turn_sd_deg = Eigen::Vector3d::Zero();
};

// Lays the odometry on the globe while it runs (P4's future work). It estimates heading and place
// in the plane, height, tilt, and the receiver's slow, steady and fast errors (ReceiverFilters).
// The headings of a second antenna count while the positions do not contradict them. Takes the
// poses in order of time, and the fixes up to each before it. Memory and work on a scan do not grow
// with the run. Deterministic; not thread-safe.
class OnlineGeoreference {
 public:
  explicit OnlineGeoreference(const OnlineGeoreferenceConfig& config);

  // Fixes without a position are passed over. `antenna_in_body`: metres. `second_in_body`: the
  // antenna that headings lead to; without it they do not count.
  void add_fix(const GnssFix& fix, const Eigen::Vector3d& antenna_in_body,
               const std::optional<Eigen::Vector3d>& second_in_body = {});
  // The next pose of the odometry, in the frame that it calls its world. Fixes up to its stamp
  // count.
  [[nodiscard]] GlobalPose add_pose(const StampedPose& pose);
  // Before the next pose: the world frame was moved (loop closure, levelling). The body is where it
  // was on the globe.
  void move_world(const Pose& new_world_from_old_world);
  // Before the next pose: how it lies to the poses so far is not known.
  void begin_piece();

  [[nodiscard]] std::uint64_t pairs() const { return pairs_; }
  // What became of the headings of a second antenna at the last pair.
  [[nodiscard]] bool has_headings() const { return turn_.known(); }
  [[nodiscard]] bool contradicts_headings() const { return contradicts_headings_; }

  // The whole state, bit for bit. `load` into one with the same configuration.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct WaitingFix {
    GnssFix fix;
    Eigen::Vector3d antenna_in_body;
    Eigen::Vector3d baseline_in_body;  // to the second one; zero: its place is not known
  };
  // What the filters say together, at the antenna of the last pair.
  struct Place {
    bool known = false;
    bool heading_known = false;
    Eigen::Vector4d linear = Eigen::Vector4d::Zero();  // cosine, sine, shift; no heading needed
    Eigen::Matrix4d linear_covariance = Eigen::Matrix4d::Zero();
    double turn_rad = 0.0;  // enu from odometry
    Eigen::Vector2d antenna_in_enu = Eigen::Vector2d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // turn, east, north
    bool height_known = false;
    Eigen::Vector3d height = Eigen::Vector3d::Zero();  // up, slope along x, along y
    Eigen::Matrix3d height_covariance = Eigen::Matrix3d::Zero();
  };

  void take(const WaitingFix& waiting, const Pose& odometry_from_body, TimeNs stamp);
  void take(const SatellitePair& pair);
  void take_in_plane(const SatellitePair& pair, const Eigen::Vector2d& antenna, double way_m);
  void take_height(const SatellitePair& pair, const Eigen::Vector3d& antenna, double way_m);
  void begin_anew();
  void sum_up_plane(const Eigen::Vector2d& antenna);
  void sum_up_kinds(const Eigen::Vector2d& antenna, bool with_headings);
  void sum_up_height();
  [[nodiscard]] Eigen::Vector3d tilt() const;
  [[nodiscard]] Eigen::Vector3d levelled(const Eigen::Vector3d& point) const;
  [[nodiscard]] GlobalPose pose_on_globe(const Pose& odometry_from_body, TimeNs stamp) const;
  // East and north of a place `at` from the reference, with variances.
  void place_in_plane(const Eigen::Vector2d& at, Eigen::Vector2d& in_enu,
                      Eigen::Vector2d& variance) const;
  void turn_on_globe(const Eigen::Quaterniond& odometry_from_body, GlobalPose& pose) const;

  OnlineGeoreferenceConfig config_;
  PlaneFilters plane_;
  HeightFilters height_;
  std::optional<GeodeticPlace> origin_;
  std::deque<WaitingFix> waiting_;
  GatheredPair gathered_;
  Pose odometry_from_world_;
  std::optional<StampedPose> last_;                       // odometry from body
  Eigen::Vector3d reference_ = Eigen::Vector3d::Zero();   // of the filters, odometry frame
  Eigen::Vector2d at_antenna_ = Eigen::Vector2d::Zero();  // of the last pair, from the reference
  double way_m_ = 0.0;
  double way_at_pair_m_ = 0.0;
  std::optional<double> plane_at_s_;   // time of the last pair
  std::optional<double> height_at_s_;  // of the last with a height
  TimeNs first_fix_ = 0;
  std::uint64_t pairs_ = 0;
  std::uint64_t outliers_in_a_row_ = 0;
  TurnFilter turn_;  // by the second antenna
  bool contradicts_headings_ = false;
  Place place_;
};

}  // namespace understory
