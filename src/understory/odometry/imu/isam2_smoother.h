#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "understory/odometry/imu/window_smoother.h"

namespace understory {

// iSAM2 (GTSAM), as P2 and P4 use it, with memory bounded by starting anew from the marginal of the
// latest state every `restart` states. Gravity is fixed. The state is written as the inputs since
// the last start and read by replaying them, which gives the same bits. Not thread-safe.
class Isam2Smoother {
 public:
  struct Config {
    int restart = 100;
    ImuNoiseConfig imu;
  };

  Isam2Smoother(const Config& config, const ImuState& state, const Matrix15d& covariance,
                const Eigen::Vector3d& gravity);
  // From what save() wrote.
  Isam2Smoother(const Config& config, BinaryReader& reader);
  ~Isam2Smoother();
  Isam2Smoother(const Isam2Smoother&) = delete;
  Isam2Smoother& operator=(const Isam2Smoother&) = delete;

  void add(TimeNs stamp, const MotionInterval& interval, const std::optional<PoseFactor>& lidar);
  // Takes the lidar factor of the last add() out again.
  void drop_latest_lidar();

  [[nodiscard]] const ImuState& latest() const { return latest_; }
  [[nodiscard]] const Matrix15d& covariance() const { return covariance_; }
  [[nodiscard]] const Eigen::Vector3d& gravity() const { return gravity_; }

  // Starts anew in the moved world.
  void move_world(const Pose& new_from_old);

  void save(BinaryWriter& writer) const;

 private:
  struct Graph;  // GTSAM's side
  struct Step {
    TimeNs stamp;
    MotionInterval interval;
    std::optional<PoseFactor> lidar;
    bool dropped = false;
  };

  void start(const ImuState& state, const Matrix15d& covariance);
  void apply(const Step& step);
  void apply_drop();
  void read_estimate(TimeNs stamp);

  Config config_;
  Eigen::Vector3d gravity_;
  ImuState start_state_;
  Matrix15d start_covariance_;
  std::vector<Step> steps_;  // since the last start
  ImuState latest_;
  Matrix15d covariance_;
  std::unique_ptr<Graph> graph_;
};

}  // namespace understory
