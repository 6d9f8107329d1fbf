#include "understory/recording/captures/pcap_sensors.h"

#include <optional>
#include <utility>
#include <vector>

#include "understory/recording/captures/hesai/hesai.h"
#include "understory/recording/captures/livox_packets.h"
#include "understory/recording/messages/livox_sensor.h"

namespace understory {
namespace {

class HesaiPcap : public DecodedPcap<HesaiDecoder> {
 public:
  HesaiPcap(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar,
            const HesaiConfig& config, Log& log)
      : DecodedPcap(std::move(file), std::move(survey), lidar, config, log) {
    lidar_statistics_.report().type = "Hesai packets";
    rig_.lidar_model = survey_.streams[lidar].model;
    rig_.lidar_extrinsic_source = "is the body, there being no IMU";
  }

  std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports = PcapRecording::topics();
    reports.front().conventions = decoder_.conventions();
    return reports;
  }

 private:
  void take(const Datagram& datagram) override {
    if (!from_lidar(datagram) || !is_hesai_data(datagram.payload)) return ignore(datagram);
    decoder_.add_packet(datagram.payload.data(), datagram.payload.size(), datagram.stamp);
    take_scans();
  }
  std::string sensor() const override { return "Hesai " + rig_.lidar_model; }
  std::string unused_sensor(const Datagram& datagram) const override {
    return is_hesai_data(datagram.payload) ? "another lidar"
                                           : PcapRecording::unused_sensor(datagram);
  }
};

class LivoxPcap : public DecodedPcap<LivoxDecoder> {
 public:
  LivoxPcap(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar, Log& log)
      : DecodedPcap(std::move(file), std::move(survey), lidar, LivoxConfig(), log) {
    lidar_statistics_.report().type = "Livox packets";
    second_statistics_.report().role = "imu";
    second_statistics_.report().type = "Livox IMU packets";
    second_statistics_.report().conventions = "g converted to m/s²; rad/s; with gravity";
    rig_.lidar_model = survey_.streams[lidar].model;
    for (const auto& [key, stream] : survey_.streams) {
      if (key.same_sensor(lidar) && stream.livox_imu > 0) imu_ = key;
    }
    if (imu_) place_imu();
  }

  std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports = PcapRecording::topics();
    reports.front().conventions = decoder_.conventions();
    return reports;
  }

 private:
  void place_imu() {
    second_statistics_.report().name = imu_->name();
    rig_.body_frame = "imu";
    rig_.body_from_imu = Pose();
    rig_.imu_extrinsic_source = "is the body frame";
    const bool known = rig_.lidar_model == "Mid-360";
    rig_.lidar_extrinsic_source = known ? "user manual of the Mid-360" : "assumed identity";
    if (known) {
      rig_.body_from_lidar = mid360_lidar_from_imu().inverse();
      return;
    }
    log_.warn("recording.livox_imu_place",
              file_->name() +
                  ": packets of a Livox do not tell its model: lidar and IMU are taken to sit in "
                  "one place. Give --extrinsics FILE with the place of the IMU by the manual");
  }

  // One stream may hold both.
  void take(const Datagram& datagram) override {
    const auto head = livox_head(datagram.payload);
    const bool of_imu = head && head->imu;
    if (of_imu && imu_ && stream_of(datagram) == *imu_) {
      const auto sample =
          decoder_.add_imu_packet(datagram.payload.data(), datagram.payload.size(), datagram.stamp);
      if (!sample) return;
      second_statistics_.add_stamp(sample->stamp);
      ready_.emplace_back(*sample);
    } else if (from_lidar(datagram) && !of_imu) {
      decoder_.add_packet(datagram.payload.data(), datagram.payload.size(), datagram.stamp);
      take_scans();
    } else {
      ignore(datagram);
    }
  }
  std::string sensor() const override {
    return rig_.lidar_model.empty() ? "Livox" : "Livox " + rig_.lidar_model;
  }
  std::string unused_sensor(const Datagram& datagram) const override {
    const auto head = livox_head(datagram.payload);
    if (!head) return PcapRecording::unused_sensor(datagram);
    return head->imu ? "the IMU" : "another lidar";
  }

  std::optional<UdpStream> imu_;
};

}  // namespace

std::unique_ptr<PcapRecording> open_hesai_pcap(std::unique_ptr<PcapFile> file, PcapSurvey survey,
                                               UdpStream lidar, const std::string& calibration_file,
                                               Log& log) {
  HesaiConfig config;
  config.calibration = find_hesai_calibration(file->name(), calibration_file);
  return std::make_unique<HesaiPcap>(std::move(file), std::move(survey), lidar, config, log);
}

std::unique_ptr<PcapRecording> open_livox_pcap(std::unique_ptr<PcapFile> file, PcapSurvey survey,
                                               UdpStream lidar, Log& log) {
  return std::make_unique<LivoxPcap>(std::move(file), std::move(survey), lidar, log);
}

}  // namespace understory
