#include "understory/recording/messages/message_recording.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <map>
#include <utility>

#include "understory/recording/captures/nmea.h"
#include "understory/recording/extrinsics.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/arrival_times.h"
#include "understory/recording/messages/cloud_topic.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/messages/fix_joiner.h"
#include "understory/recording/messages/imu_unit.h"
#include "understory/recording/messages/livox_sensor.h"
#include "understory/recording/messages/message_decode.h"
#include "understory/recording/messages/message_survey.h"
#include "understory/recording/messages/packet_topic.h"
#include "understory/recording/messages/sensor_places.h"
#include "understory/recording/messages/topic_statistics.h"
#include "understory/recording/messages/two_receivers.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::size_t kSamplesToJudge = 20;  // of an IMU, by which its unit is told
constexpr int kMostMerged = 15;              // lidars besides the first one in one scan
constexpr double kSamePlaceM = 0.001;
constexpr double kSameAngle = 0.001;

// ROS 1 drivers wrote "/velodyne" and "velodyne" alike.
std::string_view bare_frame(std::string_view frame) {
  while (!frame.empty() && frame.front() == '/')
    frame.remove_prefix(1);
  return frame;
}

class MessageRecording : public Recording, public ArrivalTimes {
 public:
  MessageRecording(std::string file, const MessageSourceFactory& open, const OpenOptions& options,
                   Log& log)
      : file_(std::move(file)),
        log_(log),
        clouds_(file_, log),
        places_(survey_.transforms, options.extrinsics_file, options.lidar_entry, log),
        receivers_(file_, !options.gnss_topic.empty(), log) {
    Log quiet;  // the same damage will be met again when reading
    const auto ahead = open(quiet);
    survey_ = survey_messages(*ahead);
    survey_late_topics(*ahead, options, survey_);
    choice_ = choose_topics(survey_, options, file_, log_);
    if (!choice_.quality.empty()) fixes_.expect_quality();
    if (topic_of_headings(survey_) != nullptr) fixes_.expect_heading();
    for (const TopicSurvey& topic : survey_.topics)
      frame_of_topic_[topic.topic] = topic.frame;
    source_ = open(log_);
    calibration_file_ = options.metadata_file;
    places_.frames() = frames_of(choice_, survey_);
    clouds_.know_livox(survey_.find(choice_.lidar), places_, survey_.transforms);
    warn_of_unread_lidars(survey_, file_, log_);
    make_rig(ahead->sensor_metadata());
    if (places_.lacks_any() && survey_late_transforms(*ahead, survey_)) place_sensors();
    warn_of_missing_place();
    receivers_.judge(choice_, places_);
    judge_lidar();
    judge_imu();
    survey_.topics.clear();
  }

  std::optional<Event> next() override {
    RawMessage message;
    while (events_.empty() && !ended_) {
      if (!source_->next(message)) {
        ended_ = true;
        fixes_.flush(events_);
        receivers_.judge(choice_, fixes_.baseline(), true);
        if (packets_) packets_->finish(events_);
        break;
      }
      fixes_.pass_time(message.log_time, events_);
      take(message);
      last_log_time_ = message.log_time;
    }
    if (events_.empty()) return std::nullopt;
    Event event = std::move(events_.front());
    events_.pop_front();
    scan_given_ = scan_given_ || std::holds_alternative<ScanPtr>(event);
    return event;
  }

  [[nodiscard]] bool save(BinaryWriter& writer) const override {
    source_->save(writer);
    survey_.transforms.save(writer);
    put_strings(writer, frame_of_topic_);
    for (const std::string& text :
         {choice_.lidar, choice_.imu, choice_.gnss, choice_.quality, choice_.second_gnss,
          places_.frames().lidar, places_.frames().imu, places_.frames().gnss,
          places_.frames().second_gnss})
      writer.put(text);
    put_rig(writer, places_.rig());
    writer.put(scan_given_);
    clouds_.save(writer);
    imu_unit_.save(writer);
    writer.put(static_cast<std::uint64_t>(topics_.size()));
    for (const auto& [name, statistics] : topics_)
      statistics.save(writer);
    put_events(writer, events_);
    fixes_.save(writer);
    receivers_.save(writer);
    writer.put(packet_maker_);
    if (packets_) packets_->save(writer);
    writer.put(ended_);
    return true;
  }

  void load(BinaryReader& reader) override {
    source_->load(reader);
    survey_.transforms.load(reader);
    frame_of_topic_ = get_strings(reader);
    for (std::string* text : {&choice_.lidar, &choice_.imu, &choice_.gnss, &choice_.quality,
                              &choice_.second_gnss, &places_.frames().lidar, &places_.frames().imu,
                              &places_.frames().gnss, &places_.frames().second_gnss})
      *text = reader.get_string();
    places_.rig() = get_rig(reader);
    scan_given_ = reader.get<bool>();
    clouds_.load(reader);
    imu_unit_.load(reader);
    topics_.clear();
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
      TopicStatistics statistics;
      statistics.load(reader);
      topics_.emplace(statistics.report().name, std::move(statistics));
    }
    get_events(reader, events_);
    fixes_.load(reader);
    receivers_.load(reader);
    const auto maker = reader.get_enum(PacketMaker::kHesai);
    if (maker != PacketMaker::kNone) packets(maker).load(reader);
    ended_ = reader.get<bool>();
  }

  [[nodiscard]] const Rig& rig() const override { return places_.rig(); }
  [[nodiscard]] std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports;
    for (const auto& [name, statistics] : topics_)
      reports.push_back(statistics.report());
    return reports;
  }
  [[nodiscard]] std::string format() const override { return source_->format(); }
  [[nodiscard]] double progress() const override { return source_->progress(); }
  [[nodiscard]] std::optional<TimeNs> arrival() const override { return last_log_time_; }

 private:
  void make_rig(const std::map<std::string, std::string>& metadata) {
    const auto model = metadata.find("lidar_model");
    if (model != metadata.end()) places_.rig().lidar_model = model->second;
    const auto rings = metadata.find("ring_count");
    if (rings != metadata.end()) clouds_.know_rings(std::atoi(rings->second.substr(0, 6).c_str()));
    const auto merged = metadata.find("merged_lidars");
    const int lidars = merged == metadata.end() ? 0 : std::atoi(merged->second.c_str());
    clouds_.know_merged(lidars > 0);
    places_.set_merged_lidars(static_cast<std::size_t>(std::clamp(lidars, 0, kMostMerged)));
    place_sensors();
  }

  // Once a scan has been given the body stays what it is.
  bool place_sensors() {
    const bool placed = places_.place(scan_given_);
    if (!choice_.second_gnss.empty()) fixes_.expect_second_position(receivers_.distance_m(places_));
    return placed;
  }

  void warn_of_missing_place() {
    if (choice_.imu.empty() || choice_.lidar.empty()) return;
    const std::string why = places_.why_no_imu();
    if (!why.empty()) log_.warn("recording.no_imu_extrinsics", file_ + ": " + why);
  }

  // A sensor that begins later than the start of the recording was looked at.
  void note_frame(std::string& known, const std::string& frame) {
    if (!known.empty() || frame.empty()) return;
    known = frame;
    place_sensors();
    if (&known == &places_.frames().imu) warn_of_missing_place();
    if (&known == &places_.frames().second_gnss) receivers_.judge(choice_, places_);
  }

  void judge_lidar() {
    const TopicSurvey* lidar = survey_.find(choice_.lidar);
    if (lidar == nullptr) return;
    const TopicSurvey* imu = survey_.find(choice_.imu);
    clouds_.judge(*lidar, imu == nullptr ? std::vector<TimeNs>() : imu->delays);
  }

  void judge_imu() {
    const TopicSurvey* imu = survey_.find(choice_.imu);
    if (imu == nullptr || imu->late) {
      imu_unit_.forget();
    } else if (imu->delays.size() >= kSamplesToJudge) {
      judge_imu_by(imu->specific_force_sum / static_cast<double>(imu->delays.size()));
    }
  }

  void judge_imu_by(double mean_specific_force) {
    if (!imu_unit_.judge(mean_specific_force)) return;
    log_.warn("imu.in_g", file_ + ": " + choice_.imu +
                              ": the accelerations are in g; converted to m/s^2 (x 9.80665)");
  }

  void take(const RawMessage& message) {
    const TopicRole role = role_of(*message.channel);
    TopicStatistics& topic = statistics_of(*message.channel, role);
    if (!is_chosen(message.channel->topic, role)) {
      topic.add_stamp(message.log_time);
      return;
    }
    const MessageReader reader(message.data, message.channel->serialization);
    bool decoded = true;
    switch (role) {
      case TopicRole::kCloud:
        decoded = take_cloud(topic, reader, message.log_time);
        break;
      case TopicRole::kLivox:
        decoded = take_livox(topic, reader, message.log_time);
        break;
      case TopicRole::kVelodynePackets:
      case TopicRole::kNebulaPackets:
      case TopicRole::kPandarPackets:
      case TopicRole::kHesaiFrames:
        decoded = take_packets(topic, decode_packets(role, reader));
        break;
      case TopicRole::kImu:
        decoded = take_imu(topic, reader);
        break;
      case TopicRole::kMag:
        decoded = take_mag(topic, reader);
        break;
      case TopicRole::kNavSatFix:
      case TopicRole::kGpsFix:
        decoded = take_gnss(topic, role, message, reader);
        break;
      case TopicRole::kNmea:
        decoded = take_sentence(topic, reader);
        break;
      case TopicRole::kTransforms:
        decoded = take_transforms(topic, reader, message.log_time);
        break;
      default:
        break;
    }
    if (decoded) return;
    ++topic.report().unreadable;
    log_.warn("recording.unreadable_message",
              file_ + ": " + message.channel->topic + ": a message of " +
                  std::to_string(message.data.size()) + " bytes is no whole " +
                  message.channel->type + "; passed over");
  }

  // The first message of a kind that the first seconds did not have makes its topic the one used.
  bool is_chosen(const std::string& topic, TopicRole role) {
    const auto adopt = [&](std::string& chosen) {
      if (chosen.empty()) chosen = topic;
      return chosen == topic;
    };
    switch (role) {
      case TopicRole::kCloud:
      case TopicRole::kLivox:
      case TopicRole::kVelodynePackets:
      case TopicRole::kNebulaPackets:
      case TopicRole::kPandarPackets:
      case TopicRole::kHesaiFrames:
        return adopt(choice_.lidar);
      case TopicRole::kImu:
        return adopt(choice_.imu);
      case TopicRole::kNavSatFix:
        return adopt(choice_.gnss) || is_of_second_antenna(topic);
      case TopicRole::kGpsFix:
        if (topic == choice_.second_gnss) return true;
        return choice_.gnss.empty() || choice_.gnss == topic ? adopt(choice_.gnss)
                                                             : adopt(choice_.quality);
      case TopicRole::kMag:
      case TopicRole::kNmea:
      case TopicRole::kTransforms:
        return true;
      default:
        return false;
    }
  }

  // Another topic of positions that begins late is one where sentences tell no heading.
  bool is_of_second_antenna(const std::string& topic) {
    const auto first = topics_.find(choice_.gnss);
    const bool alike = first != topics_.end() &&
                       first->second.report().type.find("NavSatFix") != std::string::npos;
    if (alike && choice_.second_gnss.empty() && !fixes_.expects_heading())
      choice_.second_gnss = topic;
    return topic == choice_.second_gnss;
  }

  TopicStatistics& statistics_of(const MessageChannel& channel, TopicRole role) {
    const auto found = topics_.find(channel.topic);
    if (found != topics_.end()) return found->second;
    TopicReport report;
    report.name = channel.topic;
    report.type = channel.type;
    report.role = is_chosen(channel.topic, role) ? role_name(role) : "ignored";
    return topics_.emplace(channel.topic, TopicStatistics(report)).first->second;
  }

  // Whether a message comes from another sensor on the same topic, by its frame. There is one place
  // for one lidar and one IMU: what comes from a second would be taken to come from there. Frames
  // that /tf_static puts into the same place are one.
  bool is_of_another(TopicStatistics& topic, const std::string& frame, const char* what) {
    std::string& own = frame_of_topic_[topic.report().name];
    if (own.empty()) own = frame;
    if (frame.empty() || bare_frame(frame) == bare_frame(own)) return false;
    const auto own_from_frame = survey_.transforms.find(own, frame);
    if (own_from_frame && own_from_frame->translation().norm() < kSamePlaceM &&
        own_from_frame->angle() < kSameAngle)
      return false;
    ++topic.report().left_out;
    report_finding(log_, Finding::kOtherSensor,
                   file_ + ": " + topic.report().name + ": holds " + what +
                       " of two sensors (frames " + own + " and " + frame + "); those of " + frame +
                       " are left out: record each sensor on a topic of its own");
    return true;
  }

  bool take_cloud(TopicStatistics& topic, const MessageReader& reader, TimeNs log_time) {
    const auto cloud = decode_point_cloud2(reader);
    if (!cloud) return false;
    if (is_of_another(topic, cloud->header.frame, "clouds")) return true;
    return emit(topic, cloud->header, clouds_.add(*cloud, log_time, topic.report()));
  }

  bool take_livox(TopicStatistics& topic, const MessageReader& reader, TimeNs log_time) {
    const auto message = decode_livox(reader);
    if (!message) return false;
    const MessageHeader& header = message->cloud.header;
    if (is_of_another(topic, header.frame, "clouds")) return true;
    if (clouds_.is_of_another(*message, topic.report())) return true;
    return emit(topic, header, clouds_.add(*message, log_time, topic.report()));
  }

  bool emit(TopicStatistics& topic, const MessageHeader& header, ScanPtr scan) {
    if (scan == nullptr) return false;
    topic.add_stamp(header.stamp);
    topic.report().frame = header.frame;
    note_frame(places_.frames().lidar, header.frame);
    events_.emplace_back(std::move(scan));
    return true;
  }

  PacketTopic& packets(PacketMaker maker) {
    if (!packets_) {
      packet_maker_ = maker;
      const bool ros1 = source_->format().rfind("ROS 1", 0) == 0;
      packets_ = make_packet_topic(maker, {file_, choice_.lidar, ros1, calibration_file_}, log_);
    }
    return *packets_;
  }

  bool take_packets(TopicStatistics& topic, const std::optional<PacketsMessage>& message) {
    if (!message) return false;
    if (is_of_another(topic, message->header.frame, "packets")) return true;
    topic.add_stamp(message->header.stamp);
    topic.report().frame = message->header.frame;
    note_frame(places_.frames().lidar, message->header.frame);
    if (!packets_ && message->packets.empty()) return true;
    topic.report().points += packets(packet_maker(*message)).add(*message, events_);
    topic.report().conventions = packets_->conventions();
    if (places_.rig().lidar_model.empty()) places_.rig().lidar_model = packets_->model();
    return true;
  }

  bool take_imu(TopicStatistics& topic, const MessageReader& reader) {
    auto imu = decode_imu(reader);
    if (!imu) return false;
    if (is_of_another(topic, imu->header.frame, "samples")) return true;
    topic.add_stamp(imu->sample.stamp);
    topic.report().frame = imu->header.frame;
    if (!imu_unit_.known()) judge_imu_by(imu->sample.specific_force.norm());
    note_frame(places_.frames().imu, imu->header.frame);
    topic.report().conventions =
        imu_unit_.text() + (imu->sample.orientation ? "; with orientation" : "");
    if (!imu->sample.specific_force.allFinite() || !imu->sample.angular_rate.allFinite()) {
      ++topic.report().not_numbers;
      log_.warn("imu.not_finite", file_ + ": " + topic.report().name + ": a sample at " +
                                      format_seconds(imu->sample.stamp) +
                                      " is not finite; dropped");
      return true;
    }
    imu_unit_.convert(imu->sample);
    events_.emplace_back(imu->sample);
    return true;
  }

  // Transforms of the first seconds are known already; what comes later is used from then on.
  bool take_transforms(TopicStatistics& topic, const MessageReader& reader, TimeNs log_time) {
    const auto transforms = decode_transforms(reader);
    if (!transforms) return false;
    topic.add_stamp(log_time);
    for (const TransformMessage& each : *transforms) {
      if (!survey_.transforms.add(each.parent, each.child, each.parent_from_child)) continue;
      if (!place_sensors()) continue;
      log_.warn("recording.late_extrinsics",
                file_ + ": the place of " + each.child + " on " + each.parent + " comes only at " +
                    format_seconds(log_time) + " s: sensors that need it are used from then on");
    }
    return true;
  }

  bool take_mag(TopicStatistics& topic, const MessageReader& reader) {
    const auto mag = decode_magnetic_field(reader);
    if (!mag) return false;
    topic.add_stamp(mag->sample.stamp);
    topic.report().frame = mag->header.frame;
    topic.report().conventions = "tesla";
    if (mag->sample.field.allFinite()) {
      events_.emplace_back(mag->sample);
    } else {
      ++topic.report().not_numbers;
    }
    return true;
  }

  bool take_gnss(TopicStatistics& topic, TopicRole role, const RawMessage& message,
                 const MessageReader& reader) {
    const auto gnss =
        role == TopicRole::kGpsFix ? decode_gps_fix(reader) : decode_nav_sat_fix(reader);
    if (!gnss) return false;
    topic.add_stamp(gnss->fix.stamp);
    topic.report().frame = gnss->header.frame;
    topic.report().conventions = "WGS 84, height above the ellipsoid";
    if (message.channel->topic == choice_.second_gnss) {
      topic.report().conventions += "; of a second antenna";
      note_frame(places_.frames().second_gnss, gnss->header.frame);
      fixes_.add_second_position(gnss->fix, events_);
      receivers_.judge(choice_, fixes_.baseline(), false);
      return true;
    }
    if (role == TopicRole::kGpsFix && message.channel->topic != choice_.gnss) {
      topic.report().conventions = "quality of the fixes";
      fixes_.expect_quality();
      fixes_.add_quality(gnss->fix, events_);
    } else {
      note_frame(places_.frames().gnss, gnss->header.frame);
      fixes_.add_position(gnss->fix, message.log_time, events_);
    }
    return true;
  }

  // Positions come by other topics; of sentences, the headings of a second antenna are used.
  bool take_sentence(TopicStatistics& topic, const MessageReader& reader) {
    const auto message = decode_nmea_sentence(reader);
    if (!message) return false;
    topic.add_stamp(message->header.stamp);
    topic.report().frame = message->header.frame;
    const auto sentence = parse_nmea(message->sentence);
    if (!sentence || !sentence->heading_deg || fixes_.baseline().known()) return true;
    topic.report().conventions = "heading of a second antenna";
    note_frame(places_.frames().second_gnss, message->header.frame);
    fixes_.expect_heading();
    fixes_.add_heading(nmea_fix(*sentence, message->header.stamp), events_);
    return true;
  }

  std::string file_;
  Log& log_;
  MessageSurvey survey_;
  TopicChoice choice_;
  CloudTopic clouds_;
  std::map<std::string, std::string> frame_of_topic_;  // of the sensor that is used
  std::unique_ptr<MessageSource> source_;
  SensorPlaces places_;
  TwoReceivers receivers_;
  bool scan_given_ = false;
  ImuUnit imu_unit_;
  std::map<std::string, TopicStatistics> topics_;
  std::deque<Event> events_;
  std::optional<TimeNs> last_log_time_;  // of the message that the waiting events came with
  FixJoiner fixes_;
  std::string calibration_file_;  // that the options name
  PacketMaker packet_maker_ = PacketMaker::kNone;
  std::unique_ptr<PacketTopic> packets_;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<Recording> open_messages(const std::string& file, const MessageSourceFactory& open,
                                         const OpenOptions& options, Log& log) {
  return std::make_unique<MessageRecording>(file, open, options, log);
}

}  // namespace understory
