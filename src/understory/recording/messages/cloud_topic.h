#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/recording/messages/message_decode.h"
#include "understory/recording/messages/message_survey.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/recording/messages/sensor_places.h"
#include "understory/recording/point_times.h"
#include "understory/recording/recording.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"

namespace understory {

// A topic of clouds (PointCloud2, or CustomMsg of a Livox): finds how its times are meant and makes
// scans of its messages. What is wrong with times is warned of. Not thread-safe.
class CloudTopic {
 public:
  // `file` names the recording in warnings; `log` must outlive this.
  CloudTopic(std::string file, Log& log) : file_(std::move(file)), log_(log) {}

  // The number of beams, where the recording itself tells it; 0: its rings are none, as the lines
  // of a Livox.
  void know_rings(int count) {
    ring_count_ = count;
    no_rings_ = count == 0;
  }
  // Whether its scans are those of several lidars, merged (kRingsALidar).
  void know_merged(bool merged) { merged_ = merged; }
  // What the first seconds tell of a Livox: its model, and where its IMU is, if both have one
  // frame. `lidar` may be null or another sensor. Warns where the place is not known.
  void know_livox(const TopicSurvey* lidar, SensorPlaces& places, TransformTree& transforms);
  // Whether a message is of another Livox than the one that is used; then it is counted as left
  // out.
  [[nodiscard]] bool is_of_another(const LivoxMessage& message, TopicReport& report);
  // The convention of times by the first seconds of the topic. `imu_delays`: as in
  // detect_point_times.
  void judge(const TopicSurvey& lidar, const std::vector<TimeNs>& imu_delays);

  // A scan of a message, counted in `report`; null if the message has no readable points.
  [[nodiscard]] ScanPtr add(const PointCloud2Message& cloud, TimeNs log_time, TopicReport& report);
  // The same for a Livox. Its lines are no rings: ring_count is 0. The tag numbers the returns in
  // messages of the first livox_ros_driver, not in those of livox_ros_driver2.
  [[nodiscard]] ScanPtr add(const LivoxMessage& message, TimeNs log_time, TopicReport& report);

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  void set_convention(TimeConvention convention, const std::string& topic);
  std::optional<ConvertedCloud> convert(const PointCloud2Message& cloud, TimeNs log_time,
                                        TopicReport& report);
  void warn_of(const ConvertedCloud& converted, const std::string& topic, bool in_order);

  std::string file_;
  Log& log_;
  std::optional<TimeConvention> convention_;
  int ring_count_ = 0;
  bool no_rings_ = false;
  bool merged_ = false;
  std::optional<int> livox_id_;  // of the sensor that is used
};

}  // namespace understory
