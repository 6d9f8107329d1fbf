#include "understory/recording/messages/message_survey.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "understory/recording/captures/hesai/hesai_tables.h"
#include "understory/recording/captures/nmea.h"
#include "understory/recording/messages/message_decode.h"
#include "understory/recording/messages/packet_topic.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

constexpr std::size_t kEnoughClouds = 8;
constexpr std::size_t kMostSamples = 2000;
constexpr std::size_t kMostFrames = 16;
constexpr std::uint64_t kMostBytes = 256ULL << 20;
constexpr TimeNs kEnoughTime = 2 * kNsPerSecond;
constexpr TimeNs kMostTime = 60 * kNsPerSecond;

class Surveyor {
 public:
  explicit Surveyor(MessageSurvey& survey) : survey_(survey) {}

  void add(const RawMessage& message) {
    TopicSurvey& topic = topic_of(*message.channel);
    ++topic.messages;
    if (!message.channel->readable) return;
    const MessageReader reader(message.data, message.channel->serialization);
    switch (topic.role) {
      case TopicRole::kCloud:
        return add_cloud(topic, reader, message.log_time);
      case TopicRole::kLivox:
        return add_livox(topic, decode_livox(reader), message.log_time);
      case TopicRole::kVelodynePackets:
      case TopicRole::kNebulaPackets:
      case TopicRole::kPandarPackets:
      case TopicRole::kHesaiFrames:
        return add_packets(topic, decode_packets(topic.role, reader));
      case TopicRole::kImu:
        return add_imu(topic, reader, message.log_time);
      case TopicRole::kNavSatFix:
        return add_frame(topic, decode_nav_sat_fix(reader));
      case TopicRole::kGpsFix:
        return add_frame(topic, decode_gps_fix(reader));
      case TopicRole::kNmea:
        return add_sentence(topic, decode_nmea_sentence(reader));
      case TopicRole::kTransforms:
        return add_transforms(reader);
      default:
        return;
    }
  }

  void add_transforms(const MessageReader& reader) {
    const auto transforms = decode_transforms(reader);
    if (!transforms) return;
    for (const TransformMessage& each : *transforms)
      survey_.transforms.add(each.parent, each.child, each.parent_from_child);
  }

  [[nodiscard]] std::size_t max_clouds() const {
    std::size_t most = 0;
    for (const TopicSurvey& topic : survey_.topics) {
      if (is_packets(topic.role)) most = std::max<std::size_t>(most, topic.messages);
      for (const auto& [frame, clouds] : topic.clouds)
        most = std::max(most, clouds.size());
    }
    return most;
  }

 private:
  TopicSurvey& topic_of(const MessageChannel& channel) {
    const auto [at, is_new] = index_.try_emplace(channel.topic, survey_.topics.size());
    if (is_new) {
      survey_.topics.emplace_back();
      survey_.topics.back().topic = channel.topic;
      survey_.topics.back().type = channel.type;
      survey_.topics.back().role = role_of(channel);
    }
    return survey_.topics[at->second];
  }

  static void add_cloud(TopicSurvey& topic, const MessageReader& reader, TimeNs log_time) {
    const auto cloud = decode_point_cloud2(reader);
    if (cloud) add_cloud(topic, *cloud, log_time);
  }

  static void add_livox(TopicSurvey& topic, const std::optional<LivoxMessage>& message,
                        TimeNs log_time) {
    constexpr std::size_t kMostIds = 16;
    if (!message) return;
    add_cloud(topic, message->cloud, log_time);
    if (topic.livox_ids.size() < kMostIds || topic.livox_ids.count(message->lidar_id) > 0)
      topic.livox_ids[message->lidar_id] += message->cloud.width + 1;
    const auto layout = CloudLayout::find(message->cloud);
    if (layout) topic.lines = std::max(topic.lines, highest_ring(message->cloud, *layout) + 1);
  }

  static void add_cloud(TopicSurvey& topic, const PointCloud2Message& message, TimeNs log_time) {
    const PointCloud2Message* cloud = &message;
    const auto layout = CloudLayout::find(*cloud);
    if (!layout) return;
    topic.time_field = layout->time_field();
    topic.time_type = layout->time_type();
    const std::size_t points =
        cloud->point_step > 0 ? cloud->data.size() / cloud->point_step : std::size_t{0};
    topic.points += points;
    note_frame(topic, cloud->header.frame, points + 1);
    if (topic.clouds.size() >= kMostFrames && topic.clouds.count(cloud->header.frame) == 0) return;
    std::vector<CloudTimes>& clouds = topic.clouds[cloud->header.frame];
    if (clouds.size() < kMostSamples) clouds.push_back(measure_times(*cloud, *layout, log_time));
  }

  // Two sensors may share a topic: the one with more data counts.
  static void note_frame(TopicSurvey& topic, const std::string& frame, std::size_t amount) {
    if (topic.frames.size() >= kMostFrames && topic.frames.count(frame) == 0) return;
    const std::uint64_t sum = topic.frames[frame] += amount;
    if (topic.frames.count(topic.frame) == 0 || sum > topic.frames[topic.frame])
      topic.frame = frame;
  }

  static void add_packets(TopicSurvey& topic, const std::optional<PacketsMessage>& message) {
    if (!message) return;
    note_frame(topic, message->header.frame, message->packets.size());
    const bool hesai = packet_maker(*message) == PacketMaker::kHesai;
    topic.points += (hesai ? 256 : 384) * message->packets.size();  // as many in a packet
    if (hesai) topic.unread = hesai_kind(message->packets.front().data).other;
  }

  static void add_imu(TopicSurvey& topic, const MessageReader& reader, TimeNs log_time) {
    const auto imu = decode_imu(reader);
    if (!imu || topic.delays.size() >= kMostSamples) return;
    note_frame(topic, imu->header.frame, 1);
    topic.delays.push_back(log_time - imu->sample.stamp);
    if (imu->sample.specific_force.allFinite())
      topic.specific_force_sum += imu->sample.specific_force.norm();
  }

  static void add_sentence(TopicSurvey& topic, const std::optional<NmeaMessage>& message) {
    if (!message) return;
    const auto sentence = parse_nmea(message->sentence);
    if (!sentence || !sentence->heading_deg) return;
    ++topic.headings;
    topic.frame = message->header.frame;
  }

  template <typename Message>
  static void add_frame(TopicSurvey& topic, const std::optional<Message>& message) {
    if (message) topic.frame = message->header.frame;
  }

  MessageSurvey& survey_;
  std::map<std::string, std::size_t> index_;
};

// "sensor_msgs/msg/Imu" and "sensor_msgs/Imu" are the same.
std::string short_type(const std::string& type) {
  std::string name = type;
  const std::size_t middle = name.find("/msg/");
  if (middle != std::string::npos) name.erase(middle, 4);
  return name;
}

bool is_lidar(TopicRole role) {
  return role == TopicRole::kCloud || role == TopicRole::kLivox || is_packets(role);
}

// Chooses among the topics that `wanted` accepts: the one named, else that of the highest `score`.
template <typename Wanted, typename Score>
std::string choose(const MessageSurvey& survey, const std::string& named, const std::string& what,
                   const std::string& file, Log& log, const Wanted& wanted, const Score& score) {
  std::string known;
  const TopicSurvey* best = nullptr;
  std::size_t count = 0;
  for (const TopicSurvey& topic : survey.topics) {
    if (!wanted(topic.role)) continue;
    ++count;
    known += (known.empty() ? "" : ", ") + topic.topic;
    if (topic.topic == named) return named;
    if (best == nullptr || score(topic) > score(*best)) best = &topic;
  }
  if (!named.empty())
    throw InputError(file, "topic " + named,
                     "no such " + what + " topic" + (known.empty() ? "" : "; there are " + known));
  if (count > 1)
    log.warn("recording.several_" + what + "_topics",
             file + ": several " + what + " topics (" + known + "); using " + best->topic +
                 (what == "lidar" ? "; --lidar-topic A,B merges lidars of one machine" : ""));
  return best == nullptr ? "" : best->topic;
}

}  // namespace

TopicRole role_of(const MessageChannel& channel) {
  static const std::map<std::string, TopicRole> kRoles = {
      {"sensor_msgs/PointCloud2", TopicRole::kCloud},
      {"livox_ros_driver/CustomMsg", TopicRole::kLivox},
      {"livox_ros_driver2/CustomMsg", TopicRole::kLivox},
      {"livox_interfaces/CustomMsg", TopicRole::kLivox},
      {"velodyne_msgs/VelodyneScan", TopicRole::kVelodynePackets},
      {"nebula_msgs/NebulaPackets", TopicRole::kNebulaPackets},
      {"pandar_msgs/PandarScan", TopicRole::kPandarPackets},
      {"hesai_lidar/PandarScan", TopicRole::kPandarPackets},
      {"hesai_ros_driver/UdpFrame", TopicRole::kHesaiFrames},
      {"sensor_msgs/Imu", TopicRole::kImu},
      {"sensor_msgs/MagneticField", TopicRole::kMag},
      {"sensor_msgs/NavSatFix", TopicRole::kNavSatFix},
      {"gps_msgs/GPSFix", TopicRole::kGpsFix},
      {"gps_common/GPSFix", TopicRole::kGpsFix},
      {"nmea_msgs/Sentence", TopicRole::kNmea},
      {"tf2_msgs/TFMessage", TopicRole::kTransforms},
      {"tf/tfMessage", TopicRole::kTransforms},
  };
  if (!channel.readable) return TopicRole::kIgnored;
  const auto found = kRoles.find(short_type(channel.type));
  if (found == kRoles.end()) return TopicRole::kIgnored;
  // Only what never changes is an extrinsic.
  const bool is_static = channel.topic.find("tf_static") != std::string::npos;
  if (found->second == TopicRole::kTransforms && !is_static) return TopicRole::kIgnored;
  return found->second;
}

const char* role_name(TopicRole role) {
  switch (role) {
    case TopicRole::kCloud:
    case TopicRole::kLivox:
    case TopicRole::kVelodynePackets:
    case TopicRole::kNebulaPackets:
    case TopicRole::kPandarPackets:
    case TopicRole::kHesaiFrames:
      return "lidar";
    case TopicRole::kImu:
      return "imu";
    case TopicRole::kMag:
      return "mag";
    case TopicRole::kNavSatFix:
    case TopicRole::kGpsFix:
    case TopicRole::kNmea:
      return "gnss";
    case TopicRole::kTransforms:
      return "tf";
    default:
      return "ignored";
  }
}

const TopicSurvey* MessageSurvey::find(const std::string& topic) const {
  for (const TopicSurvey& each : topics) {
    if (each.topic == topic) return &each;
  }
  return nullptr;
}

MessageSurvey survey_messages(MessageSource& source) {
  MessageSurvey survey;
  Surveyor surveyor(survey);
  RawMessage message;
  std::uint64_t bytes = 0;
  std::optional<TimeNs> start;
  int late = 0;  // more than one, because a single log time may be damaged
  const auto next = [&] {
    try {
      return source.next(message);
    } catch (const ReadError&) {
      if (surveyor.max_clouds() == 0) throw;
      return false;  // met again when it is read
    }
  };
  while (next()) {
    surveyor.add(message);
    bytes += message.data.size();
    if (!start) start = message.log_time;
    const TimeNs elapsed = message.log_time - *start;
    const bool enough = elapsed >= kEnoughTime && surveyor.max_clouds() >= kEnoughClouds;
    late += enough || elapsed >= kMostTime ? 1 : 0;
    if (late > 3 || bytes >= kMostBytes) break;
  }
  return survey;
}

namespace {

// None where the system cannot read them: met again when the recording is read.
std::vector<StoredMessage> readable_messages(MessageSource& source, const WantedChannel& wanted,
                                             std::size_t most) {
  try {
    return source.first_messages(wanted, most);
  } catch (const ReadError&) {
    return {};
  }
}

void add_late_topic(const RawMessage& first, MessageSurvey& survey) {
  if (survey.find(first.channel->topic) != nullptr) return;
  MessageSurvey alone;
  Surveyor(alone).add(first);
  // One message says what it is and where it sits, not how its clock or its units are.
  TopicSurvey& topic = alone.topics.front();
  topic.clouds.clear();
  topic.delays.clear();
  topic.late = true;
  survey.topics.push_back(std::move(topic));
}

// Where no index leads to a topic that the user names, the recording is read until it comes.
void search_named_topics(MessageSource& source, const OpenOptions& options, MessageSurvey& survey) {
  std::set<std::string> missing;
  for (const std::string& name : {options.lidar_topic, options.imu_topic, options.gnss_topic}) {
    if (!name.empty() && survey.find(name) == nullptr) missing.insert(name);
  }
  RawMessage message;
  try {
    while (!missing.empty() && source.next(message)) {
      if (missing.erase(message.channel->topic) > 0) add_late_topic(message, survey);
    }
  } catch (const ReadError&) {
    // Met again when it is read.
  }
}

}  // namespace

void survey_late_topics(MessageSource& source, const OpenOptions& options, MessageSurvey& survey) {
  const auto wanted = [&](const MessageChannel& channel) {
    const TopicRole role = role_of(channel);
    return role != TopicRole::kIgnored && role != TopicRole::kTransforms &&
           survey.find(channel.topic) == nullptr;
  };
  for (const StoredMessage& first : readable_messages(source, wanted, 1))
    add_late_topic({first.channel, first.log_time, first.data}, survey);
  search_named_topics(source, options, survey);
}

bool survey_late_transforms(MessageSource& source, MessageSurvey& survey) {
  constexpr std::size_t kMost = 64;
  const auto wanted = [](const MessageChannel& channel) {
    return role_of(channel) == TopicRole::kTransforms;
  };
  const std::vector<StoredMessage> found = readable_messages(source, wanted, kMost);
  Surveyor surveyor(survey);
  for (const StoredMessage& each : found)
    surveyor.add_transforms(MessageReader(each.data, each.channel->serialization));
  return !found.empty();
}

const TopicSurvey* topic_of_headings(const MessageSurvey& survey) {
  for (const TopicSurvey& topic : survey.topics) {
    if (topic.headings > 0) return &topic;
  }
  return nullptr;
}

namespace {

std::string second_antenna_topic(const MessageSurvey& survey, const std::string& first) {
  const TopicSurvey* own = survey.find(first);
  if (own == nullptr || topic_of_headings(survey) != nullptr) return "";
  MessageSurvey others;
  for (const TopicSurvey& topic : survey.topics) {
    if (topic.role == own->role && topic.topic != first) others.topics.push_back(topic);
  }
  Log quiet;
  return choose(
      others, "", "second_gnss", "", quiet, [](TopicRole) { return true; },
      [&](const TopicSurvey& topic) {
        return std::tuple(topic.frame != own->frame, !topic.late, topic.messages);
      });
}

}  // namespace

TopicChoice choose_topics(const MessageSurvey& survey, const OpenOptions& options,
                          const std::string& file, Log& log) {
  TopicChoice choice;
  // A lidar without times per point is worth less than any with them.
  choice.lidar = choose(
      survey, options.lidar_topic, "lidar", file, log, is_lidar, [](const TopicSurvey& topic) {
        const bool timed = topic.role != TopicRole::kCloud || !topic.time_field.empty();
        return std::tuple(!topic.late, timed, topic.points);
      });
  const auto max_messages = [](const TopicSurvey& topic) {
    return std::pair(!topic.late, topic.messages);
  };
  choice.imu = choose(
      survey, options.imu_topic, "imu", file, log,
      [](TopicRole role) { return role == TopicRole::kImu; }, max_messages);
  const auto has = [&](TopicRole wanted) {
    return std::any_of(survey.topics.begin(), survey.topics.end(),
                       [&](const TopicSurvey& topic) { return topic.role == wanted; });
  };
  const auto early = [&](TopicRole wanted) {
    return std::any_of(survey.topics.begin(), survey.topics.end(), [&](const TopicSurvey& topic) {
      return topic.role == wanted && !topic.late;
    });
  };
  const TopicSurvey* named = survey.find(options.gnss_topic);
  const bool only_gps_fix =
      !has(TopicRole::kNavSatFix) || (early(TopicRole::kGpsFix) && !early(TopicRole::kNavSatFix));
  const bool by_gps_fix = named != nullptr ? named->role == TopicRole::kGpsFix : only_gps_fix;
  const TopicRole gnss_role = by_gps_fix ? TopicRole::kGpsFix : TopicRole::kNavSatFix;
  const auto positions =
      std::count_if(survey.topics.begin(), survey.topics.end(),
                    [&](const TopicSurvey& topic) { return topic.role == gnss_role; });
  Log quiet;  // of two topics, what becomes of the second is told when the antennas' places are
              // known
  const bool maybe_antennas = positions == 2 && topic_of_headings(survey) == nullptr;
  choice.gnss = choose(
      survey, options.gnss_topic, "gnss", file, maybe_antennas ? quiet : log,
      [&](TopicRole role) { return role == gnss_role; }, max_messages);
  choice.second_gnss = second_antenna_topic(survey, choice.gnss);
  if (!by_gps_fix && has(TopicRole::kGpsFix))
    choice.quality = choose(
        survey, "", "gnss_quality", file, log,
        [](TopicRole role) { return role == TopicRole::kGpsFix; }, max_messages);
  return choice;
}

SensorFrames frames_of(const TopicChoice& choice, const MessageSurvey& survey) {
  const auto frame_of = [&](const std::string& topic) {
    const TopicSurvey* found = survey.find(topic);
    return found == nullptr ? std::string() : found->frame;
  };
  const TopicSurvey* headings = topic_of_headings(survey);
  return {frame_of(choice.lidar), frame_of(choice.imu), frame_of(choice.gnss),
          headings == nullptr ? frame_of(choice.second_gnss) : headings->frame};
}

}  // namespace understory
