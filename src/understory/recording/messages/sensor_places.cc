#include "understory/recording/messages/sensor_places.h"

namespace understory {

bool SensorPlaces::place(bool body_stays) {
  if (body_stays) return extrinsics_file_.empty() && complete_rig(transforms_, frames_, rig_);
  const bool had_imu = rig_.body_from_imu.has_value();
  const std::string model = rig_.lidar_model;
  rig_ = rig_from_transforms(transforms_, frames_);
  rig_.lidar_model = model;
  apply_extrinsics();
  return !had_imu && rig_.body_from_imu;
}

// The file speaks of the recording's body by its frame or by the sensor's kind.
void SensorPlaces::apply_extrinsics() {
  if (extrinsics_file_.empty()) return;
  const std::string own = rig_.body_frame == "imu"     ? frames_.imu
                          : rig_.body_frame == "lidar" ? frames_.lidar
                                                       : rig_.body_frame;
  Log quiet;
  apply_extrinsics_file(extrinsics_file_, {own}, rig_, extrinsics_told_ ? quiet : log_);
  extrinsics_told_ = true;
}

bool SensorPlaces::lacks_any() const {
  return (!frames_.imu.empty() && !rig_.body_from_imu) ||
         (!frames_.gnss.empty() && !rig_.body_from_gnss) ||
         (!frames_.second_gnss.empty() && !rig_.body_from_second_gnss);
}

}  // namespace understory
