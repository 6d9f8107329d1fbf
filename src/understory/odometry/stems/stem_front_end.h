#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "understory/features/lidar_stems.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/imu/imu_watch.h"
#include "understory/odometry/stems/gathered_scan.h"
#include "understory/odometry/stems/sparse_odometry.h"
#include "understory/odometry/stems/stem_imu.h"
#include "understory/preprocess/machine_boxes.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/config/config.h"

namespace understory {

// Which positioned scans are kept as views for the map.
struct ViewChoiceConfig {
  enum class Rule {
    kFixed,    // moved or turned by a fixed amount
    kOverlap,  // P0: what looks much like the views before is skipped
    kRegion,   // left a share of ICP's convergence region, P0 (26), about the last one
  };
  Rule rule = Rule::kFixed;
  double distance_m = 0.5;
  double turn_deg = 12.0;
  double overlap = 0.95;
  double region = 0.25;
};
void describe(ConfigTable& table, ViewChoiceConfig& config);

// Which stems of which scans are positioned. Settings below `stems`.
struct StemFrontEndConfig {
  double min_score = 0.5;     // of a stem to be used
  double max_range_m = 42.0;  // of a stem's returns
  bool predict_turn = true;   // the guess of a match goes on turning as before
  ViewChoiceConfig keep;
  StemImuConfig imu;
  SparseOdometryConfig odometry;
  // Around parts of the machine: what lies in them is no stem, and hides what lies behind. Not in
  // the table of keys: who reads the configuration reads the file that holds them. Null: none.
  std::shared_ptr<const std::vector<MachineBox>> machine_boxes;
};
void describe(ConfigTable& table, StemFrontEndConfig& config);

// What became of one scan.
struct StemScan {
  bool positioned = true;
  StemView view;    // body frame as it stood at the scan's stamp
  SparseStep step;  // world_from_body at the scan's stamp
  bool keep = false;
  double motion_rad_s = 0.0;  // rate of turn that was taken out of the scan
  // Where constant motion since the scan before would have led it; empty without one.
  std::optional<Pose> expected;
  double reach_m = 0.0;  // nine of ten stems are nearer
};

// Raw scans to positions from their stems alone. Stems of each scan (features/stem_segments.h) are
// moved to its stamp by the motion at their times, then matched to those before. The motion within
// a scan is first guessed from the steps before it and, once the scan has been matched, taken from
// its own step. An IMU, where there is one, tells turns and helps to hold the tilt, as long as it
// agrees with the stems. Not thread-safe; deterministic.
class StemFrontEnd {
 public:
  explicit StemFrontEnd(const StemFrontEndConfig& config)
      : config_(config), odometry_(config.odometry), imu_(config.imu), watch_(kGravity, nullptr) {}

  // `frame` is the number of the scan in the recording; scans may be left out. `samples` of the IMU
  // reach from the scan before to this one's end, as far as there are any; may be null.
  [[nodiscard]] StemScan add(const Scan& scan, int frame, const Rig& rig,
                             const ImuBuffer* samples = nullptr);
  [[nodiscard]] const SparseOdometry& odometry() const { return odometry_; }
  // Whether the IMU agrees with the stems; left out from then on where it is sure to do harm.
  [[nodiscard]] ImuTrust imu_trust() const { return watch_.trust(); }
  // Of the body up to the scan that was added last, right perturbation; zero where it does not
  // follow the one before.
  [[nodiscard]] const Vector6d& motion_per_s() const { return motion_per_s_; }
  // How scans from here on are gathered (gathered_scan.h): `samples` may be null.
  [[nodiscard]] GatheredMotion gathered_motion(const ImuBuffer* samples) const;
  [[nodiscard]] const std::vector<MachineBox>* machine_boxes() const {
    return config_.machine_boxes.get();
  }
  // From here on by stems alone.
  void refuse_imu() { config_.imu.use = false; }

  // The whole state, bit for bit; `load` in place of the scans so far, same configuration.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  static constexpr double kGravity = 9.81;  // m/s^2, anywhere on earth to half a percent

  // The stems of a scan, lidar by lidar. `up`: in the frame of the first lidar.
  struct FoundStems {
    std::vector<LidarStems> lidars;
    Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
    bool any = false;
  };
  // The stems of a scan along up as it was last. Without that, up is the direction, of those that
  // may be up, along which most stems stand.
  [[nodiscard]] FoundStems find_stems(const Scan& scan, const Rig& rig, const ImuBuffer* samples);
  // Up in the lidar as it was last. At first both ends of gravity, where there is an IMU, of the z
  // axis of the lidar and of that of the body. An earlier one is the likelier.
  [[nodiscard]] std::vector<Eigen::Vector3d> possible_ups(const Scan& scan, const Rig& rig,
                                                          const ImuBuffer* samples) const;
  [[nodiscard]] StemView view_of(const Scan& scan, int frame, const FoundStems& found,
                                 const Vector6d& motion_per_s) const;
  // What takes the scan from the one before to now: how the body moves within it, and where.
  struct Guess {
    Vector6d motion_per_s = Vector6d::Zero();
    std::optional<Pose> step;
    std::optional<StemImu::Motion> by_imu;
  };
  [[nodiscard]] Guess guess(const Scan& scan, int frame, const Rig& rig, const FoundStems& found,
                            const ImuBuffer* samples, double since) const;
  [[nodiscard]] bool to_be_kept(const StemScan& result);
  // Holds the turn to this scan by the stems against that by the gyroscope, and gravity.
  void watch_imu(const StemScan& result, const Rig& rig, const ImuBuffer* samples);

  StemFrontEndConfig config_;
  SparseOdometry odometry_;
  StemImu imu_;
  ImuWatch watch_;
  bool last_matched_ = false;  // the scan before was
  std::optional<Eigen::Vector3d> up_in_lidar_;
  std::optional<StampedPose> last_;
  std::optional<Pose> last_kept_;
  double best_overlap_ = 0.0;                 // with the local map, since a view was kept
  Vector6d motion_per_s_ = Vector6d::Zero();  // of the body, right perturbation
};

}  // namespace understory
