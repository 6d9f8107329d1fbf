#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "understory/odometry/dense/lidar_agreement.h"
#include "understory/odometry/dense/scan_motion.h"
#include "understory/odometry/dense/scan_path.h"
#include "understory/odometry/dense/scan_tops.h"
#include "understory/odometry/motion/motion_model.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/preprocess/carried_returns.h"
#include "understory/preprocess/deskew.h"
#include "understory/preprocess/isolated_points.h"
#include "understory/preprocess/machine_boxes.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/preprocess/weather_filter.h"
#include "understory/registration/matcher.h"
#include "understory/registration/penalties.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"
#include "understory/util/config/config.h"
#include "understory/util/log.h"
#include "understory/util/timing.h"

namespace understory {

// When a match counts, and how it is begun; whatever method makes it.
struct ScanMatchConfig {
  // A match counts only with this share of the scan's points near the map.
  double min_inlier_ratio = 0.1;
  // Nor does one that suddenly finds less than this share of what matches found before it. The
  // position has jumped then, or something stands before the lidar. (In good runs no scan finds
  // less than 0.8 of it.)
  double min_inlier_share = 0.5;
  // But a scan with few rings that turns over even ground lies between the rings of the map, and
  // finds little of what is there. Such a match counts if what it finds lies on the map's surfaces
  // within this many times the usual distance. (Scans of another place have 1.9 times and more.) 0:
  // it does not count.
  double few_found_residual = 0.0;
  // The match begins from far (MatchStart) where the prediction may be off by more than this share
  // of the local map's reach (one sigma). It does so, too, where the last scan found no match.
  double coarse_above_sigma = 0.25;
  // Weight of the prediction in the match, 0 = it is only the start. In directions that a scan
  // leaves undetermined the prior keeps the match from wandering.
  double prior_weight = 0.0;
  PenaltyForm prior_form = PenaltyForm::kDirect;  // P3 (6-8) for the other two
};
void describe(ConfigTable& table, ScanMatchConfig& config);

// Settings of the positioning of scans, one section for each of its steps.
struct DenseOdometryConfig {
  VoxelFilterConfig voxel;  // thins a scan before matching
  IsolatedPointsConfig isolated;
  CarriedReturnsConfig carried;
  ScanTopsConfig tops;
  WeatherFilterConfig weather;
  ScanMatchConfig match;
  DeskewConfig deskew;
  MotionConfig motion;
  bool imu_enabled = true;         // false: the IMU of the recording is passed over
  std::string machine_boxes_file;  // YAML, P4-8; empty: none
  // Where no IMU tells of the motion: the first and the last pose of a scan are matched together,
  // see scan_path.h.
  // A matcher that has no cost (MatchTarget::cost) matches them rigidly.
  bool elastic_scans = true;
};
// Without `match`, which stands in the section of the matcher.
void describe(ConfigTable& table, DenseOdometryConfig& config);

// All that is known of one scan once it has a pose.
struct DenseEstimate {
  NavState state;  // at the scan's stamp
  MotionUpdate update;
  RegistrationResult match;   // status kTooFewPoints where there was no map to match to
  bool matched = false;       // the match was usable and was offered to the motion model
  std::optional<Pose> alone;  // by a second match without terms (ScanKnowledge::also_alone)
  double found_share = 1.0;   // its inlier ratio over the usual one, if it was usable
  BodyCloud cloud;            // every return outside the machine, deskewed, body frame at the stamp
  std::optional<BodyCloud> tops;  // of the cloud, where tree tops alone count
  BodyCloud thinned;              // what was matched, of the tops or of the cloud
  std::size_t weather = 0;        // returns that the weather filter dropped
  TimeNs scan_end = 0;            // time of the scan's last point
  Pose stamp_from_middle;         // motion of the body to half of its time, as it was deskewed
  double wall_ms = 0.0;
  double cpu_ms = 0.0;
};

// The pose that a part of a scan gives before the scan is whole, P4 (discussion).
struct PartEstimate {
  TimeNs stamp = 0;  // of its first point
  Pose world_from_body;
  bool matched = false;    // false: the pose is the prediction
  TimeNs end = 0;          // of its last point
  std::size_t points = 0;  // that were matched
};

// What is known of a scan's pose besides its points.
struct ScanKnowledge {
  PoseTerms terms;                  // count in its match
  std::optional<LidarFactor> pose;  // stands instead of a match
  bool also_alone = false;          // it is matched a second time, without the terms
};

// Dense lidar-inertial odometry, P4 F2 (left graph) and P2 section 2: predict, deskew, thin, match
// to the local map (null: none yet), smooth. The local map is the caller's; one scan after another
// in order of time. Not thread-safe; parallel inside.
class DenseOdometry {
 public:
  // The rig decides whether there is an IMU (body_from_imu). `times` and `log` must outlive it.
  // `features`: of the method that scans are matched by; null if it matches points.
  DenseOdometry(const DenseOdometryConfig& config, const Rig& rig,
                std::shared_ptr<const FeatureFinder> features, StageTimes& times, Log& log);

  void add_imu(const ImuSample& sample);
  [[nodiscard]] DenseEstimate process(const Scan& scan, const MatchTargetPtr& local_map,
                                      const ScanKnowledge& known = {});
  // Poses from the parts of a scan that comes next (parts_of), each matched to the local map from
  // where the motion leads. Nothing that `process` does depends on it. Empty without a local map,
  // before the first scan and for a scan that is not after the last one.
  [[nodiscard]] std::vector<PartEstimate> match_parts(const Scan& scan,
                                                      const MatchTargetPtr& local_map,
                                                      double fraction);
  // See MotionModel; before the first scan.
  void set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                          const Eigen::Vector3d& angular_rate_rad_s);
  // The IMU's place has become known, or the IMU has just appeared: it is used from the last scan
  // on. `samples`: those since shortly before that scan, in order. No change without `imu_enabled`.
  void take_imu(const Pose& body_from_imu, std::span<const ImuSample> samples);
  // The local map was moved by this (loop closure): the estimate moves along.
  void move_world(const Pose& new_world_from_old_world);

  // The position was lost; see MotionModel.
  void suspect_imu(TimeNs now) { motion_->suspect_imu(now); }
  // A run before this one found the IMU right; see MotionModel.
  void vouch_for_imu(TimeNs until) { motion_->vouch_for_imu(until); }

  [[nodiscard]] const MotionModel& motion() const { return *motion_; }
  [[nodiscard]] bool uses_imu() const { return uses_imu_; }
  // Stamp of the last scan; 0: none yet.
  [[nodiscard]] TimeNs last_scan() const { return last_scan_; }
  // Whether the times of the points fit the motion from scan to scan.
  [[nodiscard]] ScanMotion scan_motion() const { return scan_motion_.motion(); }
  // Which further lidar lies farthest off the first one, once enough scans have told.
  [[nodiscard]] std::optional<LidarOffset> lidar_offset() const { return agreement_.worst(); }
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // The cloud deskewed along a path, and thinned.
  void preprocess(const Scan& scan, const std::vector<StampedPose>& path, DenseEstimate& estimate);
  void clean(const Scan& scan, const std::vector<StampedPose>& path, DenseEstimate& estimate);
  [[nodiscard]] PartEstimate match_part(const Scan& part, const MatchTarget& local_map);
  [[nodiscard]] RegistrationResult match_cloud(const MatchTarget& local_map, const BodyCloud& cloud,
                                               const Pose& guess, const PoseTerms& terms,
                                               MatchStart start) const;
  // Whether no IMU tells of the motion.
  [[nodiscard]] bool by_scans_alone() const;
  void match_elastically(const Scan& scan, const MatchTarget& target,
                         const std::vector<StampedPose>& guess, DenseEstimate& estimate);
  void watch_scan_motion(const Scan& scan, const MatchTargetPtr& local_map,
                         const std::vector<StampedPose>& guess, const DenseEstimate& estimate);
  // Matches the points of each lidar by themselves, now and then.
  void watch_lidars(const Scan& scan, const MatchTargetPtr& local_map,
                    const DenseEstimate& estimate);
  // Where a matched scan would lie without terms.
  void match_alone(const MatchTarget& local_map, DenseEstimate& estimate);
  // Learns which of the scan's points are carried along.
  void learn_carried(const Scan& scan, const std::vector<StampedPose>& path);
  // A lidar that joins sees what is not in the map yet: what was found before says nothing then.
  void note_lidars(const Scan& scan);
  void match(const MatchTarget& local_map, const NavState& predicted, const PoseTerms& known,
             DenseEstimate& estimate);
  // Whether a usable match counts, by what those before it found.
  void compare_with_usual(DenseEstimate& estimate);

  DenseOdometryConfig config_;
  Rig rig_;
  std::shared_ptr<const FeatureFinder> features_;
  StageTimes& times_;
  Log& log_;
  bool uses_imu_;
  std::unique_ptr<MotionModel> motion_;
  std::vector<MachineBox> boxes_;
  VoxelFilter filter_;
  CarriedReturns carried_;
  WeatherFilter weather_;
  bool last_matched_ = false;
  TimeNs last_scan_ = 0;            // stamp
  std::vector<std::uint8_t> keep_;  // workspace: points of the scan outside the machine
  ScanMotionWatch scan_motion_;
  LidarAgreement agreement_;
  double usual_inliers_ = 0.0;   // running mean of the inlier ratio of matches; 0: none yet
  double usual_residual_ = 0.0;  // the same of their distance from the map's surfaces, m
  std::uint64_t lidars_ = 0;     // that have given points, a bit each
};

}  // namespace understory
