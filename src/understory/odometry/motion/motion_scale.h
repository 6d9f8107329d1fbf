#pragma once

#include <Eigen/Core>

#include "understory/util/files/binary_io.h"

namespace understory {

// Compares how the speed changes by matching with how it changes by the accelerometer. Both must
// agree in size: a lidar in feet, or one whose scans have wrong stamps, moves a multiple of what
// the accelerometer tells of. Accelerations are means over a third of a second; gravity and biases
// are constant in them and taken out. Not thread-safe.
class MotionScale {
 public:
  // What the specific force alone, turned into the world, does over a step that begins at rest.
  struct Drive {
    Eigen::Vector3d speed = Eigen::Vector3d::Zero();  // gained, m/s
    Eigen::Vector3d way = Eigen::Vector3d::Zero();    // m
  };
  // From one match to the next, in order and without a pause between calls. Takes the step in the
  // world, metres; what the force does in it; and seconds.
  void add(const Eigen::Vector3d& step, const Drive& drive, double duration_s);
  // What comes next does not follow what came last.
  void interrupt();

  // Acceleration by matching over that by the accelerometer, by least squares: 1 where they agree;
  // 0 before there is anything to compare.
  [[nodiscard]] double scale() const;
  // How well they go together, -1 to 1.
  [[nodiscard]] double correlation() const;
  // Standard deviation of the accelerometer's means: how much there is to compare, m/s^2.
  [[nodiscard]] double spread_m_s2() const;
  [[nodiscard]] int windows() const { return count_; }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct Window {
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();  // by matching
    Eigen::Vector3d swept = Eigen::Vector3d::Zero();  // integral of the speed by the forces
    double time_s = 0.0;
  };
  void close_window();
  [[nodiscard]] double product() const;
  [[nodiscard]] double square_by_force() const;
  [[nodiscard]] double square_by_match() const;

  Eigen::Vector3d speed_ = Eigen::Vector3d::Zero();  // by the forces, since the last interruption
  Window window_;
  Window last_;  // time_s 0: none
  int count_ = 0;
  Eigen::Vector3d sum_by_match_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum_by_force_ = Eigen::Vector3d::Zero();
  double products_ = 0.0;
  double squares_by_match_ = 0.0;
  double squares_by_force_ = 0.0;
};

}  // namespace understory
