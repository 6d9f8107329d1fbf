#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "understory/recording/extrinsics.h"
#include "understory/recording/messages/message_source.h"
#include "understory/recording/point_times.h"
#include "understory/recording/recording.h"

namespace understory {

// What a topic is read for.
enum class TopicRole {
  kIgnored,
  kCloud,            // sensor_msgs/PointCloud2
  kVelodynePackets,  // velodyne_msgs/VelodyneScan
  kLivox,            // CustomMsg of livox_ros_driver, livox_ros_driver2
  kNebulaPackets,    // nebula_msgs/NebulaPackets
  kPandarPackets,    // PandarScan of pandar_msgs and hesai_lidar
  kHesaiFrames,      // hesai_ros_driver/UdpFrame
  kImu,
  kMag,
  kNavSatFix,
  kGpsFix,
  kNmea,  // nmea_msgs/Sentence, for the heading of a second antenna
  kTransforms,
};

// By the message's type, in ROS 1 or ROS 2 spelling.
[[nodiscard]] TopicRole role_of(const MessageChannel& channel);

// For reports: "lidar", "imu", "gnss", "mag", "tf", "ignored".
[[nodiscard]] const char* role_name(TopicRole role);

// What the first seconds of a recording say of one topic.
struct TopicSurvey {
  std::string topic;
  std::string type;
  TopicRole role = TopicRole::kIgnored;
  std::string frame;  // of most of its data
  std::uint64_t messages = 0;
  std::uint64_t points = 0;
  std::uint64_t headings = 0;  // sentences with one
  std::string unread;          // what its packets are of, if of a sensor that is not read
  std::string time_field;
  std::string time_type;
  std::map<std::string, std::uint64_t> frames;            // points (IMU: messages) of each
  std::map<std::string, std::vector<CloudTimes>> clouds;  // of PointCloud2, by frame
  int lines = 0;                                          // of a Livox
  std::map<int, std::uint64_t> livox_ids;                 // points of each lidar_id
  std::vector<TimeNs> delays;                             // log time - stamp
  double specific_force_sum = 0.0;                        // of norms, as they come
  bool late = false;                                      // first seen behind the start
};

// What a first look at a file found.
struct MessageSurvey {
  std::vector<TopicSurvey> topics;  // in the order of appearance
  TransformTree transforms;
  [[nodiscard]] const TopicSurvey* find(const std::string& topic) const;
};

// Reads the start of a recording until two seconds have passed and the clouds suffice to judge
// their conventions. It never reads more than a minute or 256 MB.
[[nodiscard]] MessageSurvey survey_messages(MessageSource& source);

// Adds the topics of sensors that begin later: name, role and frame, and that they are late. They
// are found by the file's index; without one, only those that the options name are, by reading on.
void survey_late_topics(MessageSource& source, const OpenOptions& options, MessageSurvey& survey);

// Adds the transforms that the file's index leads to. True if there were any.
bool survey_late_transforms(MessageSource& source, MessageSurvey& survey);

// The first topic with sentences that tell a heading; nothing where there is none.
[[nodiscard]] const TopicSurvey* topic_of_headings(const MessageSurvey& survey);

// The topics to be used.
struct TopicChoice {
  std::string lidar;
  std::string imu;
  std::string gnss;     // NavSatFix, or GPSFix if there is nothing else
  std::string quality;  // GPSFix beside a NavSatFix
  // Positions of a second antenna, if they are: another topic of the kind of `gnss`, rather one
  // with a frame of its own. Empty where sentences tell headings.
  std::string second_gnss;
};

// Those that the options name, else the ones with most data. Warns where others are left out;
// throws InputError if an option names a topic that is not there.
[[nodiscard]] TopicChoice choose_topics(const MessageSurvey& survey, const OpenOptions& options,
                                        const std::string& file, Log& log);

// The frames of the sensors on those topics; empty where it is not known.
[[nodiscard]] SensorFrames frames_of(const TopicChoice& choice, const MessageSurvey& survey);

}  // namespace understory
