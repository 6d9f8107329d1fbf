#include "understory/recording/messages/sensor_places.h"

#include "understory/recording/messages/message_encode.h"
#include "understory/sensor/second_antenna_place.h"

namespace understory {
namespace {

constexpr const char* kIsBody = "is the body frame";  // as rig_from_transforms says it

}  // namespace

bool SensorPlaces::place(bool body_stays) {
  if (body_stays) return extrinsics_file_.empty() && complete_rig(transforms_, frames_, rig_);
  const bool had_imu = rig_.body_from_imu.has_value();
  const std::string model = rig_.lidar_model;
  rig_ = rig_from_transforms(transforms_, frames_);
  rig_.lidar_model = model;
  for (std::size_t i = 0; i < merged_lidars_; ++i) {
    const auto place = transforms_.find(frames_.lidar, further_lidar_frame(i));
    if (!place) break;
    rig_.further_lidars.push_back({*place, static_cast<std::uint16_t>((i + 1) * kRingsALidar)});
  }
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
  apply_extrinsics_file(extrinsics_file_, {own}, rig_, extrinsics_told_ ? quiet : log_,
                        lidar_entry_);
  extrinsics_told_ = true;
}

bool SensorPlaces::by_file() const {
  return !extrinsics_file_.empty() &&
         (rig_.gnss_extrinsic_source.rfind("extrinsics file", 0) == 0 ||
          rig_.second_gnss_extrinsic_source.rfind("extrinsics file", 0) == 0);
}

std::optional<double> SensorPlaces::antenna_distance_m(bool first_is_named) const {
  const auto second = second_antenna_of(rig_);
  if (!second || (by_file() && !first_is_named) ||
      rig_.second_gnss_extrinsic_source.rfind(kIsBody, 0) == 0)
    return std::nullopt;
  return (*second - rig_.body_from_gnss->translation()).norm();
}

std::string SensorPlaces::why_no_second_antenna(bool first_is_named) const {
  if (!rig_.body_from_second_gnss && frames_.second_gnss == frames_.gnss)
    return "both are in the frame " + frames_.gnss;
  if (rig_.second_gnss_extrinsic_source.rfind(kIsBody, 0) == 0)
    return "their frame is that of the body, " + frames_.second_gnss;
  const bool first = !rig_.body_from_gnss;
  if (first || !rig_.body_from_second_gnss)
    return "the place of " + (first ? frames_.gnss : frames_.second_gnss) +
           " on the body is not known";
  if (by_file() && !first_is_named)
    return "nothing says which of them body_from_gnss means: name its topic by --gnss-topic";
  return "the antennas sit less than a decimetre apart";
}

std::string SensorPlaces::why_no_imu() const {
  if (rig_.body_from_imu) return {};
  return "the place of the IMU (" + frames_.imu + ") relative to the lidar (" + frames_.lidar +
         ") is not known: it is not used until a transform tells it. Give --extrinsics FILE";
}

bool SensorPlaces::lacks_any() const {
  return (!frames_.imu.empty() && !rig_.body_from_imu) ||
         (!frames_.gnss.empty() && !rig_.body_from_gnss) ||
         (!frames_.second_gnss.empty() && !rig_.body_from_second_gnss);
}

}  // namespace understory
