#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/satellites/fix_covariance.h"
#include "understory/georeference/satellites/in_match/fix_drift.h"
#include "understory/georeference/satellites/online_georeference.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/registration/penalties.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// What positions by satellites do while scans are positioned: the three configurations of P3
// section 5.2.
enum class SatellitesInMatch {
  kNone,     // nothing (the paper's baseline)
  kPenalty,  // they pull at each match, P3 (8)
  kPrior,    // each scan lies where satellites and IMU say; it is not matched
};

// Where a penalty pulls at the body.
enum class PenaltyPlace {
  kAntenna,  // as P3 prints it
  kCentre    // where a pull turns nothing, centre_of_turning() of the match before
};

// Settings of satellites in matches.
struct SatelliteBeliefConfig {
  SatellitesInMatch use = SatellitesInMatch::kNone;
  PenaltyForm form = PenaltyForm::kThreePoints;
  PenaltyPlace place = PenaltyPlace::kCentre;
  double arm_m = 10.0;  // from the antenna to the points of gravity and heading
  double scale = 30.0;  // s of P3 (8): how much the points of the scan count more
  // Of the vertical by the IMU, as penalty; about each level axis.
  double gravity_sd_deg = 0.5;
  // The first stretch ends, and the world is laid on east, north, up, where heading and place are
  // known that well, one standard deviation.
  double first_heading_sd_deg = 0.3;
  double first_plane_sd_m = 0.3;
  // The heading follows the course over this way, with this standard deviation at each scan.
  double course_way_m = 3.0;
  double course_sd_deg = 10.0;
  double oldest_fix_s = 1.0;  // an older fix says nothing of a scan
  // Penalty: the error of a receiver stays for minutes. A fix with a standard deviation up to
  // `followed_sd_m` pulls to where it is: the odometry drifts about as much meanwhile. A worse one
  // only says that the antenna is within some distance of it, and pulls back to there. That is
  // `free_sd` times what the deviation is above `followed_sd_m`, in the plane and in height.
  double free_sd = 3.0;
  double followed_sd_m = 0.05;
  FixCovarianceConfig covariance;
};
void describe(ConfigTable& table, SatelliteBeliefConfig& config);

// What is believed of a scan's pose by positions of satellites, as penalties or priors of its
// match, P3 sections 3.2, 3.3 and 5.1. The path of the first stretch lays the world frame on east,
// north, up; from then on it stays there. Position: the newest fix, carried on by the odometry; a
// fix that leaves the way of the odometry counts less. Heading, while the carrier moves: the course
// by the fixes, against the body's course in the first stretch. While it stands, none. A second
// antenna tells it better, and always. Gravity: the IMU's. So nothing of it depends on how the map
// has drifted. Takes the poses in order of time, and the fixes up to each before it. Deterministic;
// not thread-safe.
class SatelliteBelief {
 public:
  // `tilt_sd_deg`: how far the world's up may be off, see tilt_sd_deg() of split_fit.h.
  SatelliteBelief(const SatelliteBeliefConfig& config, double tilt_sd_deg);

  // `antenna_in_body`, `second_in_body`: metres, see OnlineGeoreference.
  void add_fix(const GnssFix& fix, const Eigen::Vector3d& antenna_in_body,
               const std::optional<Eigen::Vector3d>& second_in_body = {});
  // The next scan, as it was positioned. `loose`: its match did not hold it in every direction.
  void add_pose(const StampedPose& pose, bool loose = false);
  // Whether the next scan is to be matched by its points alone, too.
  [[nodiscard]] bool wants_probe() const;
  // Before its pose: the last scan by its points alone, and with what is believed.
  void note_probe(const Pose& alone, const Pose& pulled);
  // Before the next pose. The world was levelled: its beginning turned with it.
  void level_world(const Pose& new_world_from_old_world);
  // Before the next pose. A loop moved the present; the world's beginning is where it was.
  void move_present(const Pose& new_world_from_old_world);
  // Before the next pose: how it lies to the poses so far is not known. A first stretch begins.
  void begin_piece();

  // Whether the fixes leave the path, and by how much they have at most.
  [[nodiscard]] const FixDrift& drift() const { return drift_; }

  // How the points held the last scan, see RegistrationResult.
  void note_match(const Matrix6d& information);

  // Whether the first stretch is over.
  [[nodiscard]] bool aligned() const { return world_from_enu_.has_value(); }
  // Whether the last pose lies where a good fix says: its place does not drift.
  [[nodiscard]] bool holds() const;
  // When it ended first; 0: it did not.
  [[nodiscard]] TimeNs aligned_at() const { return aligned_at_; }
  // What is believed of the body at a scan, whose pose by the odometry is `predicted`, world frame.
  // `level_from_world`: the turn that would bring the world's z axis onto the vertical of the IMU
  // (MotionModel). Nothing before the end of the first stretch, and where no position says
  // anything.
  [[nodiscard]] std::optional<PoseBelief> at(
      const StampedPose& predicted,
      const Eigen::Quaterniond& level_from_world = Eigen::Quaterniond::Identity()) const;
  // Of a penalty: the heading by the second antenna alone, for a term of its own; it counts while
  // the carrier stands, too. Its points lie far away, so that where the antenna is counts nothing.
  // Nothing without a fresh heading, where the form has one point, and where the two antennas
  // contradict the map.
  [[nodiscard]] std::optional<PoseBelief> heading_at(const StampedPose& predicted) const;

  // The whole state, bit for bit. `load` into one with the same configuration.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  static constexpr double kNoTurn = std::numeric_limits<double>::quiet_NaN();
  // A fix beside the path.
  struct FixOnPath {
    TimeNs stamp = 0;
    Eigen::Vector3d fix_in_world = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // world axes, m^2
    Pose world_from_body;                                      // at the stamp, by the path
    double distrust = 1.0;  // by which its standard deviation grows
    // By the second antenna: the turn about up that the body's heading lacks, with its standard
    // deviation, rad. NaN: it says nothing.
    double turn_rad = kNoTurn;
    double turn_sd_rad = kNoTurn;
  };

  // By how much the heading has to turn about up, with its standard deviation.
  struct HeadingError {
    double turn_rad = 0.0;
    double sd_rad = 0.0;
  };

  void begin_stretch();
  void align(const GlobalPose& on_globe, const StampedPose& pose);
  void note_course(const StampedPose& pose);
  void take_fixes(const StampedPose& pose);
  void forget_fixes();
  [[nodiscard]] double distrust_of(const FixOnPath& fix) const;
  void note_drift(FixOnPath& on_path);
  void note_heading(const GnssFix& fix, FixOnPath& on_path) const;
  void turn_headings(const Pose& new_from_old, double sign);
  [[nodiscard]] bool is_old(const FixOnPath& fix, TimeNs now) const;
  [[nodiscard]] std::optional<HeadingError> heading_error(const FixOnPath& newest,
                                                          const StampedPose& predicted) const;

  SatelliteBeliefConfig config_;
  double tilt_sd_deg_;
  std::optional<OnlineGeoreference> first_;  // over the first stretch, where a path drifts little
  Eigen::Vector3d antenna_in_body_ = Eigen::Vector3d::Zero();  // of the last fix
  std::optional<Eigen::Vector3d> second_in_body_;              // the same, if it is known
  std::optional<StampedPose> last_;
  Eigen::Vector3d centre_in_body_ = Eigen::Vector3d::Zero();  // of turning
  bool has_centre_ = false;
  GeodeticPlace origin_;
  std::optional<Pose> world_from_enu_;  // enu at the origin
  TimeNs aligned_at_ = 0;
  // Where the carrier goes, body frame: the sum of unit vectors over the first stretch.
  Eigen::Vector3d forward_in_body_ = Eigen::Vector3d::Zero();
  std::optional<StampedPose> course_from_;
  std::deque<GnssFix> waiting_;
  FixDrift drift_;
  int since_probe_ = 0;          // scans
  std::deque<FixOnPath> fixes_;  // the newest last, over a little more than course_way_m
};

}  // namespace understory
