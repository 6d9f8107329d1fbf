#include "understory/recording/messages/cloud_topic.h"

#include <algorithm>
#include <map>

#include "understory/recording/finding.h"
#include "understory/recording/messages/livox_sensor.h"
#include "understory/sensor/rig.h"

namespace understory {
namespace {

// Whether all points of a scan that should have times have the same one.
bool lacks_times(const Scan& scan) {
  return scan.has_point_times && scan.points.size() > 1 &&
         std::all_of(scan.points.begin(), scan.points.end(), [&](const ScanPoint& point) {
           return point.t_ns == scan.points.front().t_ns;
         });
}

// The beams of all lidars in a merged scan.
int rings_of_lidars(const Scan& scan) {
  std::map<int, int> rings;  // by lidar
  for (const ScanPoint& point : scan.points) {
    int& count = rings[point.ring / kRingsALidar];
    count = std::max(count, point.ring % kRingsALidar + 1);
  }
  int sum = 0;
  for (const auto& [lidar, count] : rings)
    sum += count;
  return sum;
}

}  // namespace

void CloudTopic::know_livox(const TopicSurvey* lidar, SensorPlaces& places,
                            TransformTree& transforms) {
  if (lidar == nullptr || lidar->role != TopicRole::kLivox) return;
  livox_id_ = busiest_livox(*lidar);
  const auto sensor = livox_sensor(*lidar);
  if (sensor) places.rig().lidar_model = sensor->model;
  SensorFrames& frames = places.frames();
  if (frames.imu.empty() || frames.imu != frames.lidar) return;
  if (sensor) {
    frames.imu += "/imu";
    transforms.add(frames.lidar, frames.imu, sensor->lidar_from_imu);
    return;
  }
  log_.warn("recording.livox_imu_place",
            file_ + ": the Livox and its IMU have one frame (" + frames.lidar +
                ") and the model is not known: they are taken to sit in one place. Give "
                "--extrinsics FILE with the place of the IMU by the sensor's manual");
}

bool CloudTopic::is_of_another(const LivoxMessage& message, TopicReport& report) {
  if (!livox_id_) livox_id_ = message.lidar_id;
  if (*livox_id_ == message.lidar_id) return false;
  ++report.left_out;
  report_finding(log_, Finding::kOtherSensor,
                 file_ + ": " + report.name + ": holds clouds of two sensors (lidar_id " +
                     std::to_string(*livox_id_) + " and " + std::to_string(message.lidar_id) +
                     "); those of the second are left out: record each sensor on a topic of its "
                     "own (multi_topic of the driver)");
  return true;
}

void CloudTopic::judge(const TopicSurvey& lidar, const std::vector<TimeNs>& imu_delays) {
  const auto clouds = lidar.clouds.find(lidar.frame);
  if (clouds == lidar.clouds.end()) return;
  set_convention(detect_point_times(lidar.time_field, lidar.time_type, clouds->second, imu_delays),
                 lidar.topic);
}

void CloudTopic::set_convention(TimeConvention convention, const std::string& topic) {
  convention_ = std::move(convention);
  if (convention_->warning.empty()) return;
  const bool missing = convention_->kind == TimeConvention::Kind::kNone;
  log_.warn(missing ? key_of(Finding::kNoPointTimes) : "recording.point_times",
            file_ + ": " + topic + ": " + convention_->warning);
}

std::optional<ConvertedCloud> CloudTopic::convert(const PointCloud2Message& cloud, TimeNs log_time,
                                                  TopicReport& report) {
  const auto layout = CloudLayout::find(cloud);
  if (!layout) return std::nullopt;
  if (!convention_)
    set_convention(detect_point_times(layout->time_field(), layout->time_type(),
                                      {measure_times(cloud, *layout, log_time)}, {}),
                   report.name);
  ConvertedCloud converted = convert_cloud(cloud, *layout, *convention_);
  report.conventions = convention_->text;
  report.points += converted.scan->points.size();
  report.empty_points += converted.without_return;
  return converted;
}

void CloudTopic::warn_of(const ConvertedCloud& converted, const std::string& topic, bool in_order) {
  const std::string of_scan = " points of the scan at " + format_seconds(converted.scan->stamp);
  if (converted.bad_times > 0)
    log_.warn("recording.bad_point_times", file_ + ": " + topic + ": " +
                                               std::to_string(converted.bad_times) + of_scan +
                                               " have impossible times; dropped");
  if (in_order && converted.backward_times > 0)
    log_.warn("recording.backward_point_times",
              file_ + ": " + topic + ": " + std::to_string(converted.backward_times) + of_scan +
                  " are earlier than the point before them; kept with the times that they have");
}

ScanPtr CloudTopic::add(const PointCloud2Message& cloud, TimeNs log_time, TopicReport& report) {
  std::optional<ConvertedCloud> converted = convert(cloud, log_time, report);
  if (!converted) return nullptr;
  if (merged_) converted->scan->ring_count = rings_of_lidars(*converted->scan);
  ring_count_ = no_rings_ ? 0 : std::max(ring_count_, converted->scan->ring_count);
  converted->scan->ring_count = ring_count_;
  warn_of(*converted, report.name, false);
  return std::move(converted->scan);
}

ScanPtr CloudTopic::add(const LivoxMessage& message, TimeNs log_time, TopicReport& report) {
  std::optional<ConvertedCloud> converted = convert(message.cloud, log_time, report);
  if (!converted) return nullptr;
  Scan& scan = *converted->scan;
  scan.ring_count = 0;
  report.conventions += "; the ring is Livox's line";
  if (report.type.rfind(kSecondDriver, 0) != 0) {
    for (ScanPoint& point : scan.points)
      point.return_index = livox_return(point.tag);
  }
  warn_of(*converted, report.name, true);
  if (lacks_times(scan)) {
    scan.has_point_times = false;
    log_.warn("recording.same_point_times",
              file_ + ": " + report.name + ": all points of the scan at " +
                  format_seconds(scan.stamp) + " have the same offset_time: it has no times");
  }
  return std::move(converted->scan);
}

void CloudTopic::save(BinaryWriter& writer) const {
  writer.put(convention_.has_value());
  if (convention_) put_convention(writer, *convention_);
  writer.put(ring_count_);
}

void CloudTopic::load(BinaryReader& reader) {
  convention_.reset();
  if (reader.get<bool>()) convention_ = get_convention(reader);
  ring_count_ = reader.get<int>();
}

}  // namespace understory
