#pragma once

#include <memory>

#include "understory/odometry/imu/imu_buffer.h"
#include "understory/odometry/imu/imu_watch.h"
#include "understory/odometry/imu/isam2_smoother.h"
#include "understory/odometry/imu/window_smoother.h"
#include "understory/odometry/motion/motion_prediction.h"
#include "understory/odometry/motion/residual_scale.h"

namespace understory {

// The motion model of lidar and IMU; without a single sample it runs on constant velocity, which is
// how the lidar-only model is made, too.
class ImuSmoother : public MotionModel {
 public:
  ImuSmoother(const MotionConfig& config, const Pose& body_from_imu, Log* log);

  // Goes on from a state that another model has come to, in its world. To be called before the
  // first scan, after the samples around that state. The vertical is learnt anew, from the IMU.
  void take_over(const NavState& state);

  void add_imu(const ImuSample& sample) override;
  void set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                          const Eigen::Vector3d& angular_rate_rad_s) override;
  [[nodiscard]] Initialisation initialisation() const override { return how_; }
  [[nodiscard]] NavState predict(TimeNs t) const override;
  [[nodiscard]] std::vector<StampedPose> predict_path(TimeNs from, TimeNs to) const override;
  MotionUpdate add_scan(TimeNs stamp, const std::optional<LidarFactor>& factor) override;
  void move_world(const Pose& new_world_from_old_world) override;
  [[nodiscard]] ImuTrust imu_trust() const override { return watch_.trust(); }
  void suspect_imu(TimeNs now) override { watch_.suspect(now); }
  void vouch_for_imu(TimeNs until) override { watch_.vouch_until(until); }
  [[nodiscard]] Eigen::Quaterniond level_from_world() const override;
  void save(BinaryWriter& writer) const override;
  void load(BinaryReader& reader) override;

 private:
  // From one match to the next: metres a second in the world, radians a second in the IMU's frame.
  struct MatchMotion {
    Eigen::Vector3d velocity;
    Eigen::Vector3d angular_rate;
  };

  [[nodiscard]] bool use_imu() const { return watch_.usable(); }
  [[nodiscard]] const ImuState& latest() const;
  [[nodiscard]] const Matrix15d& covariance() const;
  [[nodiscard]] Eigen::Vector3d gravity() const;
  [[nodiscard]] MotionPredictor predictor() const;
  [[nodiscard]] MotionPrediction predict_full(TimeNs t) const;
  [[nodiscard]] NavState to_nav(const MotionPrediction& prediction) const;

  MotionUpdate begin(TimeNs stamp);
  void learn_vertical(const MotionInterval& interval);
  [[nodiscard]] MotionInterval make_interval(TimeNs from, TimeNs to) const;
  void note_residual(const MotionPrediction& predicted, const PoseFactor& lidar);
  MotionUpdate add_matched(TimeNs stamp, const MotionInterval& interval, const PoseFactor& lidar,
                           const MatchMotion& match_motion);
  void add_state(TimeNs stamp, const MotionInterval& interval,
                 const std::optional<PoseFactor>& lidar);
  void watch_imu(TimeNs stamp, const MotionInterval& interval,
                 const std::optional<PoseFactor>& lidar);
  [[nodiscard]] MatchMotion motion_since_last_match(TimeNs stamp, const Pose& world_from_imu) const;
  void restart_at(TimeNs stamp, const PoseFactor& lidar, const MatchMotion& motion);
  void level(MotionUpdate& update);
  void hand_over_to_isam();

  MotionConfig config_;
  Pose body_from_imu_;
  Log* log_;
  ImuBuffer buffer_;
  WindowSmoother window_;
  std::unique_ptr<Isam2Smoother> isam_;  // set once the window has settled, with method isam2
  ImuWatch watch_;
  Initialisation how_ = Initialisation::kNone;
  Eigen::Vector3d angular_rate_ = Eigen::Vector3d::Zero();  // over the last interval, IMU frame
  std::optional<TimeNs> vertical_since_;                    // when the IMU first told of gravity
  bool levelled_ = false;
  std::optional<TimeNs> restarted_;  // when the estimate last began anew
  int dropped_in_a_row_ = 0;
  std::optional<ImuMatch> last_match_;
  ResidualScale residual_scale_;                     // of matches against the prediction by the IMU
  std::optional<Eigen::Vector3d> initial_velocity_;  // body frame; only until the first scan
};

}  // namespace understory
