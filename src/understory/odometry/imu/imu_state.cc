#include "understory/odometry/imu/imu_state.h"

#include "understory/geometry/pose_io.h"

namespace understory {

ImuState retract(const ImuState& state, const Vector15d& d) {
  ImuState moved = state;
  const Eigen::Quaterniond& rotation = state.world_from_imu.rotation();
  moved.world_from_imu = Pose(rotation * so3_exp(d.segment<3>(0)),
                              state.world_from_imu.translation() + rotation * d.segment<3>(3));
  moved.velocity += d.segment<3>(6);
  moved.gyro_bias += d.segment<3>(9);
  moved.accel_bias += d.segment<3>(12);
  return moved;
}

Vector15d local(const ImuState& from, const ImuState& to) {
  const Eigen::Quaterniond inverse = from.world_from_imu.rotation().conjugate();
  Vector15d d;
  d.segment<3>(0) = so3_log(inverse * to.world_from_imu.rotation());
  d.segment<3>(3) = inverse * (to.world_from_imu.translation() - from.world_from_imu.translation());
  d.segment<3>(6) = to.velocity - from.velocity;
  d.segment<3>(9) = to.gyro_bias - from.gyro_bias;
  d.segment<3>(12) = to.accel_bias - from.accel_bias;
  return d;
}

Matrix15d local_jacobian(const ImuState& from, const ImuState& to) {
  const Eigen::Quaterniond relative =
      from.world_from_imu.rotation().conjugate() * to.world_from_imu.rotation();
  Matrix15d jacobian = Matrix15d::Identity();
  jacobian.block<3, 3>(0, 0) = so3_right_jacobian_inverse(so3_log(relative));
  jacobian.block<3, 3>(3, 3) = relative.toRotationMatrix();
  return jacobian;
}

void put_state(BinaryWriter& writer, const ImuState& state) {
  writer.put(state.stamp);
  put_pose(writer, state.world_from_imu);
  writer.put_doubles(state.velocity.data(), 3);
  writer.put_doubles(state.gyro_bias.data(), 3);
  writer.put_doubles(state.accel_bias.data(), 3);
}

ImuState get_state(BinaryReader& reader) {
  ImuState state;
  state.stamp = reader.get<TimeNs>();
  state.world_from_imu = get_pose(reader);
  reader.get_doubles(state.velocity.data(), 3);
  reader.get_doubles(state.gyro_bias.data(), 3);
  reader.get_doubles(state.accel_bias.data(), 3);
  return state;
}

}  // namespace understory
