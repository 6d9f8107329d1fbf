#include "understory/recording/captures/livox_packets.h"

#include <cmath>
#include <cstring>
#include <utility>

#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/livox_sensor.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kLivoxGravity = 9.80665;
constexpr std::size_t kImuBytes = 24;
constexpr double kUsualIntervalNs = 1e9 / 240'000.0;  // of Avia and Horizon
constexpr double kLongestIntervalNs = 20'000.0;
constexpr int kMostLostPackets = 10'000;  // a larger step is a sensor that restarted

template <typename T>
T little(ByteSpan bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

// How a type of data is laid out.
struct DataType {
  std::size_t returns = 0;  // 0: not known
  std::size_t bytes = 0;    // of a firing
  std::size_t firings = 0;  // of a packet; 0: the packet tells
};

DataType type_of(int protocol, std::uint8_t type) {
  if (protocol == 2) {
    constexpr DataType kTypes[] = {{1, 24, 0}, {1, 14, 0}, {1, 8, 0}, {1, 10, 0}};
    return type < 4 ? kTypes[type] : DataType{};
  }
  constexpr DataType kTypes[] = {{1, 13, 100}, {1, 9, 100}, {1, 14, 96}, {1, 10, 96}, {2, 28, 48},
                                 {2, 16, 48},  {1, 24, 1},  {3, 42, 30}, {3, 22, 30}};
  return type < 9 ? kTypes[type] : DataType{};
}

bool is_spherical(int protocol, std::uint8_t type) {
  return protocol == 2 ? type == 3 : type == 1 || type == 3 || type == 5 || type == 8;
}

// Protocol 1, type 3: year since 2000, month, day, hour, and microseconds of the hour.
std::optional<TimeNs> utc_of(ByteSpan raw) {
  if (raw[1] < 1 || raw[1] > 12 || raw[2] < 1 || raw[2] > 31 || raw[3] > 23) return std::nullopt;
  const auto microseconds = little<std::uint32_t>(raw, 4);
  if (microseconds > 3'600'000'000U) return std::nullopt;
  // Days since 1970 of the civil calendar, in years that begin in March.
  const std::int64_t year = 2000 + raw[0] - (raw[1] <= 2 ? 1 : 0);
  const std::int64_t month = (raw[1] + 9) % 12;
  const std::int64_t days =
      365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + raw[2] - 719'469;
  return (days * 24 + raw[3]) * 3600 * kNsPerSecond + static_cast<TimeNs>(microseconds) * 1000;
}

std::optional<TimeNs> time_of(ByteSpan raw, bool utc) {
  if (utc) return utc_of(raw);
  const auto ns = little<std::uint64_t>(raw, 0);
  if (ns >> 61 != 0) return std::nullopt;
  return static_cast<TimeNs>(ns);
}

std::optional<LivoxHead> second_protocol(ByteSpan payload) {
  constexpr std::size_t kHead = 36;
  if (payload.size() < kHead || payload[0] > 3) return std::nullopt;
  LivoxHead head;
  head.data_type = payload[10];
  const DataType type = type_of(2, head.data_type);
  const auto length = little<std::uint16_t>(payload, 1);
  head.firings = little<std::uint16_t>(payload, 5);
  if (type.returns == 0 || head.firings == 0 || length != kHead + head.firings * type.bytes)
    return std::nullopt;
  head.imu = head.data_type == 0;
  head.firing_bytes = type.bytes;
  head.data_at = kHead;
  head.time_type = payload[11];
  head.time = time_of(payload.subspan(28, 8), false);
  head.interval_ns = 100.0 * little<std::uint16_t>(payload, 3) / static_cast<double>(head.firings);
  head.counter = little<std::uint16_t>(payload, 7);
  return head;
}

std::optional<LivoxHead> first_protocol(ByteSpan payload) {
  constexpr std::size_t kHead = 18;
  constexpr std::uint8_t kVersion = 5;
  if (payload.size() <= kHead || payload[0] != kVersion) return std::nullopt;
  LivoxHead head;
  head.protocol = 1;
  head.data_type = payload[9];
  const DataType type = type_of(1, head.data_type);
  if (type.returns == 0 || payload.size() != kHead + type.firings * type.bytes) return std::nullopt;
  head.imu = head.data_type == 6;
  head.firings = type.firings;
  head.returns = type.returns;
  head.firing_bytes = type.bytes;
  head.data_at = kHead;
  head.time_type = payload[8];
  head.time = time_of(payload.subspan(10, 8), head.time_type == 3);
  return head;
}

Eigen::Vector3d direction_of(std::uint16_t theta, std::uint16_t phi) {
  const double zenith = 0.01 * kDegree * theta;
  const double azimuth = 0.01 * kDegree * phi;
  return {std::sin(zenith) * std::cos(azimuth), std::sin(zenith) * std::sin(azimuth),
          std::cos(zenith)};
}

// A return of a firing: place in metres, reflectivity and tag.
struct RawReturn {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  std::uint8_t reflectivity = 0;
  std::uint8_t tag = 0;
};

RawReturn cartesian(ByteSpan firing, const LivoxHead& head, std::size_t number) {
  RawReturn result;
  if (head.protocol == 2 && head.data_type == 2) {
    for (int axis = 0; axis < 3; ++axis)
      result.place[axis] = 0.01 * little<std::int16_t>(firing, static_cast<std::size_t>(axis) * 2);
    result.reflectivity = firing[6];
    result.tag = firing[7];
    return result;
  }
  const std::size_t at = number * 14;
  for (int axis = 0; axis < 3; ++axis)
    result.place[axis] =
        0.001 * little<std::int32_t>(firing, at + static_cast<std::size_t>(axis) * 4);
  result.reflectivity = firing[at + 12];
  if (firing.size() > at + 13) result.tag = firing[at + 13];
  return result;
}

// Single returns have depth, theta, phi; of several, the angles come first, once for all.
RawReturn spherical(ByteSpan firing, const LivoxHead& head, std::size_t number) {
  const bool several = head.returns > 1;
  const std::size_t angles = several ? 0 : 4;
  const std::size_t at = several ? 4 + number * 6 : 0;
  const std::size_t behind = several ? at + 4 : 8;
  RawReturn result;
  result.place = 0.001 * little<std::uint32_t>(firing, at) *
                 direction_of(little<std::uint16_t>(firing, angles),
                              little<std::uint16_t>(firing, angles + 2));
  result.reflectivity = firing[behind];
  if (firing.size() > behind + 1) result.tag = firing[behind + 1];
  return result;
}

}  // namespace

std::optional<LivoxHead> livox_head(ByteSpan payload) {
  if (const auto head = second_protocol(payload)) return head;
  return first_protocol(payload);
}

LivoxDecoder::LivoxDecoder(const LivoxConfig& config, std::string source, Log& log)
    : config_(config), source_(source), log_(log), finished_(std::move(source), log) {}

void LivoxDecoder::damaged(const std::string& what) {
  report_finding(log_, Finding::kDamagedPacket,
                 source_ + ": Livox packet " + std::to_string(received_) + ": " + what);
}

void LivoxDecoder::add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp) {
  ++received_;
  const ByteSpan packet(data, size);
  const auto head = livox_head(packet);
  if (!head || head->imu || size < head->data_at + head->firings * head->firing_bytes) {
    damaged("of " + std::to_string(size) + " bytes is no whole packet of points");
    return;
  }
  const auto time = head->time ? clock_.time(*head->time, stamp) : std::nullopt;
  if (!time) {
    damaged("its time does not follow the one before");
    return;
  }
  if (!accept(*head, *time)) return;
  protocol_ = head->protocol;
  data_type_ = head->data_type;
  decode_waiting(*time);
  if (head->interval_ns > 0.0) {
    decode(packet, *head, *time, head->interval_ns);
  } else {
    waiting_ = Waiting{{packet.begin(), packet.end()}, *time};
  }
}

// Whether a packet is no copy of the one before. Counts those that are missing.
bool LivoxDecoder::accept(const LivoxHead& head, TimeNs time) {
  const std::optional<TimeNs> before = std::exchange(last_time_, time);
  const std::optional<std::uint16_t> counter = std::exchange(counter_, head.counter);
  const bool same_counter = !head.counter || !counter || *head.counter == *counter;
  if (before && *before == time && same_counter) {
    damaged("comes twice");
    return false;
  }
  if (head.counter && counter) {
    const int step = static_cast<std::uint16_t>(*head.counter - *counter);
    // The counter of Mid-360 begins at 0 with each frame.
    if (*head.counter != 0 && step > 1 && step < kMostLostPackets)
      damaged(std::to_string(step - 1) + " packets before it are missing");
  }
  return true;
}

void LivoxDecoder::decode_waiting(TimeNs next) {
  if (!waiting_) return;
  const Waiting packet = std::move(*waiting_);
  waiting_.reset();
  const auto head = livox_head(packet.bytes);
  if (!head) return;
  const double until = static_cast<double>(next - packet.time) / static_cast<double>(head->firings);
  if (until > 0.0 && until < kLongestIntervalNs) interval_ns_ = until;
  decode(packet.bytes, *head, packet.time, interval_ns_ > 0.0 ? interval_ns_ : kUsualIntervalNs);
}

void LivoxDecoder::decode(ByteSpan packet, const LivoxHead& head, TimeNs time, double interval_ns) {
  for (std::size_t firing = 0; firing < head.firings; ++firing) {
    const TimeNs at = time + std::llround(static_cast<double>(firing) * interval_ns);
    if (!growing_.empty() && (at - scan_begin_ >= config_.scan || at < scan_begin_ - config_.scan))
      close_scan();
    for (std::size_t number = 0; number < head.returns; ++number)
      add_point(packet.data() + head.data_at + firing * head.firing_bytes, head, firing, number,
                at);
  }
}

void LivoxDecoder::add_point(const std::uint8_t* raw, const LivoxHead& head, std::size_t firing,
                             std::size_t number, TimeNs time) {
  const ByteSpan bytes(raw, head.firing_bytes);
  const RawReturn found = is_spherical(head.protocol, head.data_type)
                              ? spherical(bytes, head, number)
                              : cartesian(bytes, head, number);
  if (found.place.isZero(0.0)) return;
  if (growing_.empty()) scan_begin_ = time;
  ScanPoint point;
  point.x = static_cast<float>(found.place.x());
  point.y = static_cast<float>(found.place.y());
  point.z = static_cast<float>(found.place.z());
  point.intensity = found.reflectivity;
  point.ring = static_cast<std::uint16_t>(firing % (head.protocol == 2 ? 4 : 6));
  point.tag = found.tag;
  if (head.protocol == 1) point.return_index = livox_return(found.tag);
  growing_.add(point, time);
}

void LivoxDecoder::close_scan() {
  finished_.add(growing_.take(0), 0.0);
}

std::optional<ImuSample> LivoxDecoder::add_imu_packet(const std::uint8_t* data, std::size_t size,
                                                      TimeNs stamp) {
  const ByteSpan packet(data, size);
  const auto head = livox_head(packet);
  if (!head || !head->imu || size < head->data_at + kImuBytes) return std::nullopt;
  const auto time = head->time ? clock_.time(*head->time, stamp) : std::nullopt;
  if (!time || (last_imu_ && *last_imu_ == *time)) return std::nullopt;
  last_imu_ = time;
  ImuSample sample;
  sample.stamp = *time;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t at = head->data_at + static_cast<std::size_t>(axis) * 4;
    sample.angular_rate[axis] = static_cast<double>(little<float>(packet, at));
    sample.specific_force[axis] =
        kLivoxGravity * static_cast<double>(little<float>(packet, at + 12));
  }
  if (!sample.angular_rate.allFinite() || !sample.specific_force.allFinite()) return std::nullopt;
  return sample;
}

void LivoxDecoder::finish() {
  decode_waiting(0);
  close_scan();
  finished_.finish();
}

void LivoxDecoder::save(BinaryWriter& writer) const {
  const auto put_time = [&](const std::optional<TimeNs>& time) {
    writer.put(time.has_value());
    writer.put(time.value_or(0));
  };
  clock_.save(writer);
  writer.put(received_);
  writer.put(counter_.has_value());
  writer.put(counter_.value_or(0));
  put_time(last_time_);
  put_time(last_imu_);
  writer.put(waiting_.has_value());
  if (waiting_) {
    writer.put(waiting_->bytes);
    writer.put(waiting_->time);
  }
  writer.put(interval_ns_);
  writer.put(data_type_);
  writer.put(protocol_);
  writer.put(scan_begin_);
  growing_.save(writer);
  finished_.save(writer);
}

void LivoxDecoder::load(BinaryReader& reader) {
  const auto get_time = [&]() -> std::optional<TimeNs> {
    const bool known = reader.get<bool>();
    const auto time = reader.get<TimeNs>();
    return known ? std::optional(time) : std::nullopt;
  };
  clock_.load(reader);
  received_ = reader.get<std::uint64_t>();
  const bool counted = reader.get<bool>();
  const auto counter = reader.get<std::uint16_t>();
  counter_ = counted ? std::optional(counter) : std::nullopt;
  last_time_ = get_time();
  last_imu_ = get_time();
  waiting_.reset();
  if (reader.get<bool>()) {
    Waiting packet;
    packet.bytes = reader.get_vector<std::uint8_t>();
    packet.time = reader.get<TimeNs>();
    waiting_ = std::move(packet);
  }
  interval_ns_ = reader.get<double>();
  data_type_ = reader.get<std::uint8_t>();
  protocol_ = reader.get<int>();
  scan_begin_ = reader.get<TimeNs>();
  growing_.load(reader, source_);
  finished_.load(reader);
}

std::string LivoxDecoder::conventions() const {
  std::string text = is_spherical(protocol_, data_type_) ? "spherical" : "cartesian";
  text += protocol_ == 2 ? "; the ring is the line, of 4" : "; the ring is the line, of 6";
  return text + (clock_.synchronised() ? "; time = sensor clock"
                                       : "; time = stamps smoothed by the sensor clock");
}

}  // namespace understory
