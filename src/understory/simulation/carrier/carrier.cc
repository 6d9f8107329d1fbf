#include "understory/simulation/carrier/carrier.h"

#include <cmath>

namespace understory {
namespace {

Eigen::Quaterniond from_euler(double roll, double pitch, double yaw) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

Pose to_pose(const Vector6d& value) {
  return {from_euler(value[3], value[4], value[5]), value.head<3>()};
}

}  // namespace

Pose CarrierPath::pose(double time_s) const {
  return to_pose(spline_.value(time_s));
}

CarrierState CarrierPath::state(double time_s) const {
  const Spline::Sample s = spline_.sample(time_s);
  const double sr = std::sin(s.value[3]);
  const double cr = std::cos(s.value[3]);
  const double sp = std::sin(s.value[4]);
  const double cp = std::cos(s.value[4]);
  const double roll_d = s.rate[3];
  const double pitch_d = s.rate[4];
  const double yaw_d = s.rate[5];
  const double roll_dd = s.acceleration[3];
  const double pitch_dd = s.acceleration[4];
  const double yaw_dd = s.acceleration[5];
  CarrierState state;
  state.world_from_body = to_pose(s.value);
  state.velocity = s.rate.head<3>();
  state.acceleration = s.acceleration.head<3>();
  // Rates of the body axes from the rates of roll, pitch, yaw (Rz Ry Rx), and their derivative.
  state.angular_rate = {roll_d - yaw_d * sp, pitch_d * cr + yaw_d * cp * sr,
                        -pitch_d * sr + yaw_d * cp * cr};
  state.angular_acceleration = {roll_dd - yaw_dd * sp - yaw_d * pitch_d * cp,
                                pitch_dd * cr - pitch_d * roll_d * sr + yaw_dd * cp * sr -
                                    yaw_d * pitch_d * sp * sr + yaw_d * roll_d * cp * cr,
                                -pitch_dd * sr - pitch_d * roll_d * cr + yaw_dd * cp * cr -
                                    yaw_d * pitch_d * sp * cr - yaw_d * roll_d * cp * sr};
  return state;
}

}  // namespace understory
