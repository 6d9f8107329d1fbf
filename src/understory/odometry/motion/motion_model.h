#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/sensor/imu_sample.h"
#include "understory/sensor/rig.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// The state of the carrier at one time, P4 (30). Velocity is that of the origin of the body frame.
struct NavState {
  TimeNs stamp = 0;
  Pose world_from_body;
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();  // m/s
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();          // rad/s, frame of the IMU
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();         // m/s^2, frame of the IMU
  Matrix6d pose_covariance = Matrix6d::Zero();  // right perturbation, rotation first (body frame)
};

// What matching one scan to the local map said.
struct LidarFactor {
  Pose world_from_body;                     // at the stamp of the scan
  double fitness_m2 = 0.0;                  // overall_fitness_m2 of the match, lower is better
  Matrix6d information = Matrix6d::Zero();  // of a right perturbation, as the matcher gives it
  // The pose is of other sensors, with this covariance of a right perturbation: it counts instead
  // of fitness and information. Neither is the IMU judged by it, nor it by the IMU (P2-8).
  std::optional<Matrix6d> covariance = {};
};

// What became of one scan's match.
enum class MotionStatus {
  kAccepted,      // the lidar factor is in the estimate
  kPredicted,     // no lidar factor was given; the state is the prediction
  kVelocityGate,  // the factor made the velocity jump and was dropped, P2-8; state = prediction
  kIgnored,       // the stamp is not after the last one; nothing changed
};

// What became of one scan.
struct [[nodiscard]] MotionUpdate {
  MotionStatus status = MotionStatus::kPredicted;
  std::string reason;  // for the log, empty if accepted
  NavState state;
  double velocity_jump_m_s = 0.0;  // what the lidar factor would have changed, or changed
  // Set (seldom, in the first seconds) when the estimate of the vertical became good enough to
  // level the world. The model has then moved its own state by new_world_from_old_world (`state` is
  // in the new world). The caller moves its map, keyframes and trajectory by the same.
  std::optional<Pose> new_world_from_old_world;
};

// How the model found its first state: at rest, while moving, or without an IMU.
enum class Initialisation { kNone, kStill, kInMotion, kNoImu };

// Agreement between the IMU and the lidar, judged over the run.
struct ImuTrust {
  bool trusted = true;
  bool usable = true;         // false: sure to do harm; the model goes on without it
  bool on_probation = false;  // contradicted; left out until it is clear whether it is right
  bool proven = false;        // agreed with the lidar over enough turning
  double doubted_s = 0.0;     // time in which it was left out, on probation
  std::string reason;         // one sentence for run.json if not trusted
  // Acceleration by matching over that by the accelerometer, and how much there was to compare; see
  // MotionScale.
  double motion_scale = 0.0;
  double motion_correlation = 0.0;
  double motion_spread_m_s2 = 0.0;
  int motion_windows = 0;
  // Time between scans in which an IMU that is usable had no samples, or too few to go by.
  double without_samples_s = 0.0;
};

// The first graph of P4 F2: a state for every scan, prediction in between. One per run, not
// thread-safe. World frame: up against gravity, the first body pose at the origin with heading zero
// of the body's x axis. Without an IMU the first body frame itself.
//
// Order of calls for a scan: first add_imu for all samples that are there, best up to the end of
// the scan. Then predict_path over the scan to deskew it, predict at its stamp as the start of the
// match, and add_scan with the result.
class MotionModel {
 public:
  virtual ~MotionModel() = default;

  // In time order. Samples out of order, with NaN or saturated are dropped with a warning.
  virtual void add_imu(const ImuSample& sample) = 0;

  // How the first attitude was found; kNone before the first scan.
  [[nodiscard]] virtual Initialisation initialisation() const = 0;
  [[nodiscard]] bool initialised() const { return initialisation() != Initialisation::kNone; }

  // What is known of the motion at the first scan, body frame; to be called before it. Without it a
  // carrier is taken to start at rest, and the first scan is not deskewed for its speed.
  virtual void set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                                  const Eigen::Vector3d& angular_rate_rad_s) = 0;

  // The state at `t`, at or after the last scan's stamp (before it: the last state). Uses the IMU
  // as far as it reaches and constant velocity beyond.
  [[nodiscard]] virtual NavState predict(TimeNs t) const = 0;

  // Poses from `from` to `to` (both included), in order of time, for deskewing a scan. There is one
  // for each IMU sample in between, and at least both ends. `from` is at or after the last scan's
  // stamp.
  [[nodiscard]] virtual std::vector<StampedPose> predict_path(TimeNs from, TimeNs to) const = 0;

  // Adds a state at `stamp`, with a lidar factor if the match was usable. The first call defines
  // the world; its factor may be empty.
  virtual MotionUpdate add_scan(TimeNs stamp, const std::optional<LidarFactor>& factor) = 0;

  // Moves the world of the estimate, e.g. when a loop closure moved the map the scans are matched
  // to. A tilt in the correction tilts what the model holds for the vertical with it.
  virtual void move_world(const Pose& new_world_from_old_world) = 0;

  // True (warned of in the log, too) unless the IMU contradicts the lidar: swapped axes, wrong
  // extrinsics, wrong units.
  [[nodiscard]] virtual ImuTrust imu_trust() const = 0;
  // The position was lost with it. Unless it has agreed with the lidar before, the IMU is left out
  // until it is clear whether it is right.
  virtual void suspect_imu(TimeNs now) = 0;
  // A run before this one left the IMU out up to `until` and found it right. Up to then it is not
  // doubted again, and matches that contradict it are dropped. To be called before the first scan.
  virtual void vouch_for_imu(TimeNs until) = 0;

  // The estimated tilt of the world frame: the rotation about a horizontal axis that would bring
  // the world's z axis onto the true vertical. Identity without an IMU.
  [[nodiscard]] virtual Eigen::Quaterniond level_from_world() const = 0;

  // The whole state, bit for bit. `load` goes into a model made with the same configuration.
  virtual void save(BinaryWriter& writer) const = 0;
  virtual void load(BinaryReader& reader) = 0;
};

// How the covariance of a lidar factor is found.
enum class LidarNoise {
  kFitness,      // P4 (36): sigma as a function of the fitness alone
  kInformation,  // from the matcher's information matrix, scaled, with a floor
  kBoth,         // the information matrix with the floor of (36)
};

// Covariance of the match of a scan, P4 (36).
struct LidarNoiseConfig {
  LidarNoise source = LidarNoise::kBoth;
  double sigma_rotation_deg = 0.05;   // floor of one match
  double sigma_translation_m = 0.01;  // floor of one match; 0.01 in the paper (0.57 deg, too)
  // tau and theta of (36); 0: those of the method that matches (FitnessNoise).
  double fitness_threshold_m2 = 0.0;
  double fitness_scale = 0.0;  // 1/m^4
  // The points of a scan are not independent: the matcher's information is divided by this.
  double information_divisor = 100.0;
};

// P4 (36) and its alternatives, as a covariance of a right perturbation of the body pose.
[[nodiscard]] Matrix6d lidar_covariance(const LidarFactor& factor, const LidarNoiseConfig& config);

// Noise of the IMU, continuous densities as an Allan deviation gives them.
struct ImuNoiseConfig {
  double gyro_noise_rad_s_sqrt_hz = 2e-3;
  double accel_noise_m_s2_sqrt_hz = 3e-2;
  double gyro_bias_walk_rad_s2_sqrt_hz = 5e-5;
  double accel_bias_walk_m_s3_sqrt_hz = 1e-3;
  double gyro_bias_sigma_rad_s = 0.03;  // of the bias at switch-on
  double accel_bias_sigma_m_s2 = 0.2;   // of the bias at switch-on
  double gravity_m_s2 = 9.81;
  double gyro_range_deg_s = 1990.0;  // a sample beyond is saturated and dropped
  double accel_range_m_s2 = 155.0;   // a sample beyond is saturated and dropped
  double max_gap_s = 0.06;           // longer: constant velocity stands in, with a warning
};

// How the last states are smoothed: a window of them, or GTSAM's iSAM2.
enum class SmootherMethod { kFixedLag, kIsam2 };
// What a match's velocity is compared with.
enum class VelocityGateReference { kPrediction, kPreviousState };

// Settings of the motion model, with IMU and without.
struct MotionConfig {
  SmootherMethod method = SmootherMethod::kFixedLag;
  int window = 15;          // states in the fixed lag
  int iterations = 2;       // Gauss-Newton steps per scan
  int isam2_restart = 100;  // states between restarts from the marginals
  ImuNoiseConfig imu;
  LidarNoiseConfig lidar;
  // P2-8. A match that changes the velocity by more than this against the reference is dropped. The
  // paper's reference is the previous state; 0 turns the gate off.
  double velocity_gate_m_s = 1.0;
  double angular_gate_deg_s = 30.0;  // the same for the turn since the last scan
  VelocityGateReference velocity_gate_reference = VelocityGateReference::kPrediction;
  int velocity_gate_patience = 5;  // drops in a row before a match is accepted after all
  // NavState::pose_covariance of a matched scan is that of the smoother, brought to the size of the
  // residuals; weights are as they were.
  bool covariance_from_residuals = true;
  bool level_world = true;  // allow new_world_from_old_world in the first seconds
  // Constant-velocity model: acceleration that the carrier is capable of.
  double motion_accel_sigma_m_s2 = 3.0;
  double motion_angular_accel_sigma_rad_s2 = 6.0;
};

void describe(ConfigTable& table, MotionConfig& config);

// Lidar and IMU: preintegrated IMU factors, P2 (2-4), and lidar factors in a smoother with bounded
// memory. `rig.body_from_imu` must be set. `log` may be null, must outlive the model.
[[nodiscard]] std::unique_ptr<MotionModel> make_imu_smoother(const MotionConfig& config,
                                                             const Rig& rig, Log* log);
// Lidar alone: constant velocity.
[[nodiscard]] std::unique_ptr<MotionModel> make_constant_velocity_model(const MotionConfig& config,
                                                                        Log* log);

}  // namespace understory
