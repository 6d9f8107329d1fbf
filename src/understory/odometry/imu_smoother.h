#pragma once

#include <memory>

#include "understory/odometry/imu_buffer.h"
#include "understory/odometry/isam2_smoother.h"
#include "understory/odometry/trust_monitor.h"
#include "understory/odometry/window_smoother.h"

namespace understory {

// The motion model of lidar and IMU; without a single sample it runs on constant velocity, which is
// how the lidar-only model is made, too.
class ImuSmoother : public MotionModel {
 public:
  ImuSmoother(const MotionConfig& config, const Pose& body_from_imu, Log* log);

  void add_imu(const ImuSample& sample) override;
  void set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                          const Eigen::Vector3d& angular_rate_rad_s) override;
  [[nodiscard]] Initialisation initialisation() const override { return how_; }
  [[nodiscard]] NavState predict(TimeNs t) const override;
  [[nodiscard]] std::vector<StampedPose> predict_path(TimeNs from, TimeNs to) const override;
  MotionUpdate add_scan(TimeNs stamp, const std::optional<LidarFactor>& factor) override;
  void move_world(const Pose& new_world_from_old_world) override;
  [[nodiscard]] ImuTrust imu_trust() const override;
  void suspect_imu(TimeNs now) override;
  [[nodiscard]] Eigen::Quaterniond level_from_world() const override;
  void save(BinaryWriter& writer) const override;
  void load(BinaryReader& reader) override;

 private:
  // A state with how fast it turns (frame of the IMU) and what is known of it.
  struct Prediction {
    ImuState state;
    Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();
    Matrix9d covariance = Matrix9d::Zero();  // rotation, position, velocity
  };
  struct LastMatch {
    TimeNs stamp;
    Pose world_from_imu;
  };

  [[nodiscard]] bool use_imu() const { return monitor_.usable(); }
  [[nodiscard]] const ImuState& latest() const;
  [[nodiscard]] const Matrix15d& covariance() const;
  [[nodiscard]] Eigen::Vector3d gravity() const;
  [[nodiscard]] Prediction predict_full(TimeNs t) const;
  [[nodiscard]] Prediction advance(const Prediction& from, const Preintegration& motion,
                                   TimeNs stamp) const;
  [[nodiscard]] Preintegration coast(double duration, const Eigen::Vector3d& angular_rate) const;
  [[nodiscard]] NavState to_nav(const Prediction& prediction) const;

  MotionUpdate begin(TimeNs stamp);
  void learn_vertical(const MotionInterval& interval);
  [[nodiscard]] MotionInterval make_interval(TimeNs from, TimeNs to) const;
  MotionUpdate add_matched(TimeNs stamp, const MotionInterval& interval, const PoseFactor& lidar,
                           const Eigen::Vector3d& match_velocity);
  void add_state(TimeNs stamp, const MotionInterval& interval,
                 const std::optional<PoseFactor>& lidar);
  [[nodiscard]] std::string gate(const Prediction& predicted, const ImuState& before,
                                 const PoseFactor& lidar, double& jump) const;
  void watch(TimeNs stamp, const MotionInterval& interval, const std::optional<PoseFactor>& lidar);
  void restart_at(TimeNs stamp, const PoseFactor& lidar, const Eigen::Vector3d& velocity);
  void note_silence(const MotionInterval& interval, TimeNs from, TimeNs stamp);
  void note_standing(TimeNs stamp, bool was_on_probation, bool was_trusted);
  void level(MotionUpdate& update);
  void hand_over_to_isam();

  MotionConfig config_;
  Pose body_from_imu_;
  Log* log_;
  ImuBuffer buffer_;
  WindowSmoother window_;
  std::unique_ptr<Isam2Smoother> isam_;  // set once the window has settled, with method isam2
  TrustMonitor monitor_;
  Initialisation how_ = Initialisation::kNone;
  Eigen::Vector3d angular_rate_ = Eigen::Vector3d::Zero();  // over the last interval, IMU frame
  std::optional<TimeNs> vertical_since_;                    // when the IMU first told of gravity
  bool levelled_ = false;
  int dropped_in_a_row_ = 0;
  bool silent_ = false;  // no IMU over the last interval
  std::optional<LastMatch> last_match_;
  std::optional<Eigen::Vector3d> initial_velocity_;  // body frame; only until the first scan
};

}  // namespace understory
