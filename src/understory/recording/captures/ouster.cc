#include "understory/recording/captures/ouster.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <numbers>

#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kStandardGravity = 9.80665;  // the unit of Ouster's accelerometer
constexpr std::size_t kPacketHeader = 32;
constexpr std::uint16_t kLidarPacketType = 1;
constexpr TimeNs kLongestStep = kNsPerSecond;
constexpr std::uint64_t kLargestTime = std::uint64_t{1} << 62;

template <typename T>
T read(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

struct PixelReturn {
  std::uint32_t range_mm = 0;
  float intensity = 0.0F;
};

struct Pixel {
  PixelReturn first;
  PixelReturn second;
};

// Layouts as in the sensors' manual, chapter "lidar data packet format".
Pixel read_pixel(OusterProfile profile, const std::uint8_t* raw) {
  constexpr std::uint32_t kRange19 = 0x7'FFFF;
  constexpr std::uint32_t kRange20 = 0xF'FFFF;
  constexpr std::uint32_t kRange15 = 0x7FFF;
  constexpr std::uint32_t kRange15UnitMm = 8;
  switch (profile) {
    case OusterProfile::kLegacy:
      return {
          {read<std::uint32_t>(raw) & kRange20, static_cast<float>(read<std::uint16_t>(raw + 6))},
          {}};
    case OusterProfile::kRng19:
      return {
          {read<std::uint32_t>(raw) & kRange19, static_cast<float>(read<std::uint16_t>(raw + 6))},
          {}};
    case OusterProfile::kDual:
      return {
          {read<std::uint32_t>(raw) & kRange19, static_cast<float>(read<std::uint16_t>(raw + 8))},
          {read<std::uint32_t>(raw + 4) & kRange19,
           static_cast<float>(read<std::uint16_t>(raw + 10))}};
    case OusterProfile::kRng15:
      return {{(read<std::uint16_t>(raw) & kRange15) * kRange15UnitMm, static_cast<float>(raw[2])},
              {}};
    case OusterProfile::kRng15Dual:
      return {
          {(read<std::uint16_t>(raw) & kRange15) * kRange15UnitMm, static_cast<float>(raw[2])},
          {(read<std::uint16_t>(raw + 4) & kRange15) * kRange15UnitMm, static_cast<float>(raw[6])}};
  }
  return {};
}

}  // namespace

bool OusterDecoder::Mark::followed_by(const Mark& next) const {
  const auto step = static_cast<std::uint16_t>(next.frame - frame);
  return step <= 1 && std::llabs(next.time - time) <= kLongestStep;
}

OusterDecoder::OusterDecoder(const OusterMetadata& metadata, std::string source, Log& log)
    : metadata_(metadata),
      source_(source),
      log_(log),
      sensor_from_lidar_rotation_(metadata.sensor_from_lidar.rotation_matrix()),
      sensor_from_lidar_translation_(metadata.sensor_from_lidar.translation()),
      seen_(static_cast<std::size_t>(metadata.columns_per_frame), false),
      finished_(std::move(source), log) {
  make_beams();
}

void OusterDecoder::make_beams() {
  const Eigen::Matrix4d& origin = metadata_.lidar_from_beam;
  range_offset_m_ = std::hypot(origin(0, 3), origin(2, 3));
  std::vector<double> sorted = metadata_.beam_altitude_deg;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const double altitude = metadata_.beam_altitude_deg[i];
    const double azimuth = -metadata_.beam_azimuth_deg[i] * kDegree;
    const auto rank = std::lower_bound(sorted.begin(), sorted.end(), altitude) - sorted.begin();
    beams_.push_back({std::cos(altitude * kDegree), std::sin(altitude * kDegree), std::cos(azimuth),
                      std::sin(azimuth), static_cast<std::uint16_t>(rank)});
  }
}

void OusterDecoder::damaged(const std::string& what) {
  report_finding(log_, Finding::kDamagedPacket,
                 source_ + ": Ouster packet " + std::to_string(received_) + ": " + what);
}

// The valid columns of a packet.
std::vector<OusterDecoder::Column> OusterDecoder::read_columns(const std::uint8_t* data) const {
  const bool legacy = metadata_.profile == OusterProfile::kLegacy;
  const std::size_t size = metadata_.column_size();
  std::vector<Column> columns;
  for (int i = 0; i < metadata_.columns_per_packet; ++i) {
    const std::uint8_t* raw =
        data + (legacy ? 0 : kPacketHeader) + static_cast<std::size_t>(i) * size;
    const bool valid = legacy ? read<std::uint32_t>(raw + size - 4) == 0xFFFF'FFFF
                              : (read<std::uint16_t>(raw + 10) & 1U) != 0;
    const auto time = read<std::uint64_t>(raw);
    Column column;
    column.time = static_cast<TimeNs>(time);
    column.measurement = read<std::uint16_t>(raw + 8);
    column.frame = legacy ? read<std::uint16_t>(raw + 10) : read<std::uint16_t>(data + 2);
    column.pixels = raw + (legacy ? 16 : 12);
    if (valid && time < kLargestTime && column.measurement < seen_.size())
      columns.push_back(column);
  }
  return columns;
}

void OusterDecoder::add_lidar_packet(const std::uint8_t* data, std::size_t size) {
  ++received_;
  if (size != metadata_.lidar_packet_size()) {
    damaged("has " + std::to_string(size) + " bytes, expected " +
            std::to_string(metadata_.lidar_packet_size()));
    return;
  }
  if (metadata_.profile != OusterProfile::kLegacy &&
      read<std::uint16_t>(data) != kLidarPacketType) {
    damaged("is of another type than lidar data");
    return;
  }
  const std::vector<Column> columns = read_columns(data);
  if (columns.empty()) return;
  const Mark mark{columns[columns.size() / 2].frame, columns[columns.size() / 2].time};
  if (last_ && !last_->followed_by(mark)) {
    // Damaged, late, or behind a gap: the last only if the next packet goes on from here.
    if (!strange_mark_ || !strange_mark_->followed_by(mark)) {
      if (strange_mark_) damaged("a packet before it does not follow the others");
      strange_mark_ = mark;
      strange_.assign(data, data + size);
      return;
    }
    close_scan();
    last_ = strange_mark_;
    add_columns(read_columns(strange_.data()), *strange_mark_);
  } else if (strange_mark_) {
    damaged("the packet before it does not follow the others");
  }
  strange_mark_.reset();
  add_columns(columns, mark);
}

void OusterDecoder::add_columns(const std::vector<Column>& columns, const Mark& mark) {
  if (last_ && last_->frame != mark.frame) close_scan();
  last_ = mark;
  for (const Column& column : columns) {
    const bool fits =
        column.frame == mark.frame && std::llabs(column.time - mark.time) <= kLongestStep;
    if (!fits) {
      damaged("the header of a column does not go with the others");
    } else if (!seen_[column.measurement]) {
      seen_[column.measurement] = true;
      add_column(column);
    }
  }
}

void OusterDecoder::add_column(const Column& column) {
  const double encoder = 2.0 * std::numbers::pi *
                         (1.0 - static_cast<double>(column.measurement) /
                                    static_cast<double>(metadata_.columns_per_frame));
  encoder_cos_ = std::cos(encoder);
  encoder_sin_ = std::sin(encoder);
  const std::size_t pixel_size = metadata_.pixel_size();
  for (std::size_t i = 0; i < beams_.size(); ++i) {
    const Pixel pixel = read_pixel(metadata_.profile, column.pixels + i * pixel_size);
    add_return(beams_[i], column, pixel.first.range_mm, pixel.first.intensity, 0);
    const std::uint8_t index = pixel.first.range_mm == 0 ? 0 : 1;
    add_return(beams_[i], column, pixel.second.range_mm, pixel.second.intensity, index);
  }
}

// The sensors' manual, chapter "lidar range to XYZ".
void OusterDecoder::add_return(const Beam& beam, const Column& column, std::uint32_t range_mm,
                               float intensity, std::uint8_t return_index) {
  if (range_mm == 0) return;
  const double range = range_mm * 1e-3 - range_offset_m_;
  const double along = range * beam.cos_altitude;
  const Eigen::Matrix4d& origin = metadata_.lidar_from_beam;
  const Eigen::Vector3d point_in_lidar(
      along * (encoder_cos_ * beam.cos_azimuth - encoder_sin_ * beam.sin_azimuth) +
          origin(0, 3) * encoder_cos_,
      along * (encoder_sin_ * beam.cos_azimuth + encoder_cos_ * beam.sin_azimuth) +
          origin(0, 3) * encoder_sin_,
      range * beam.sin_altitude + origin(2, 3));
  const Eigen::Vector3d point_in_sensor =
      sensor_from_lidar_rotation_ * point_in_lidar + sensor_from_lidar_translation_;
  ScanPoint point;
  point.x = static_cast<float>(point_in_sensor.x());
  point.y = static_cast<float>(point_in_sensor.y());
  point.z = static_cast<float>(point_in_sensor.z());
  point.intensity = intensity;
  point.ring = beam.ring;
  point.return_index = return_index;
  growing_.add(point, column.time);
}

void OusterDecoder::close_scan() {
  finished_.add(growing_.take(metadata_.pixels_per_column), missing_at_beginning());
  std::fill(seen_.begin(), seen_.end(), false);
}

// The share of the column window that lies before the first column of the scan in progress.
double OusterDecoder::missing_at_beginning() const {
  const auto first = std::find(seen_.begin(), seen_.end(), true) - seen_.begin();
  const int window = metadata_.last_column - metadata_.first_column + 1;
  if (window > 0) return static_cast<double>(first - metadata_.first_column) / window;
  // A window beyond column 0: what is seen of it.
  const auto seen = std::count(seen_.begin(), seen_.end(), true);
  return 1.0 - static_cast<double>(seen) / (metadata_.columns_per_frame + window);
}

std::optional<ImuSample> OusterDecoder::add_imu_packet(const std::uint8_t* data, std::size_t size) {
  ++received_;
  if (size != kOusterImuPacketSize) {
    damaged("IMU packet of " + std::to_string(size) + " bytes, expected 48");
    return std::nullopt;
  }
  const auto time = read<std::uint64_t>(data + 16);
  ImuSample sample;
  sample.stamp = static_cast<TimeNs>(time);
  for (int i = 0; i < 3; ++i) {
    const auto step = static_cast<std::size_t>(4 * i);
    sample.specific_force[i] = read<float>(data + 24 + step) * kStandardGravity;
    sample.angular_rate[i] = read<float>(data + 36 + step) * kDegree;
  }
  if (!sample.specific_force.allFinite() || !sample.angular_rate.allFinite() ||
      time >= kLargestTime) {
    damaged("IMU values that are not finite");
    return std::nullopt;
  }
  // A time far from the last one is damage, unless the next sample goes on from there.
  const auto near = [&](const std::optional<TimeNs>& other) {
    return other && std::llabs(sample.stamp - *other) <= kLongestStep;
  };
  if (last_imu_ && !near(last_imu_) && !near(strange_imu_)) {
    strange_imu_ = sample.stamp;
    damaged("the IMU's time does not follow the one before");
    return std::nullopt;
  }
  strange_imu_.reset();
  last_imu_ = sample.stamp;
  return sample;
}

ScanPtr OusterDecoder::take_scan() {
  return finished_.take();
}

void OusterDecoder::finish() {
  close_scan();
  finished_.finish();
}

void OusterDecoder::save(BinaryWriter& writer) const {
  writer.put(received_);
  put_optional(writer, last_);
  put_optional(writer, strange_mark_);
  writer.put(strange_);
  put_optional(writer, last_imu_);
  put_optional(writer, strange_imu_);
  put_flags(writer, seen_);
  growing_.save(writer);
  finished_.save(writer);
}

void OusterDecoder::load(BinaryReader& reader) {
  received_ = reader.get<std::uint64_t>();
  last_ = get_optional<Mark>(reader);
  strange_mark_ = get_optional<Mark>(reader);
  strange_ = reader.get_vector<std::uint8_t>();
  last_imu_ = get_optional<TimeNs>(reader);
  strange_imu_ = get_optional<TimeNs>(reader);
  const std::vector<bool> seen = get_flags(reader);
  if (seen.size() != seen_.size())
    throw InputError(source_, "", "its metadata are not those that the run was begun with");
  seen_ = seen;
  growing_.load(reader, source_);
  finished_.load(reader);
}

std::string OusterDecoder::conventions() const {
  std::string text;
  switch (metadata_.profile) {
    case OusterProfile::kLegacy:
      text = "legacy profile";
      break;
    case OusterProfile::kRng19:
      text = "RNG19_RFL8_SIG16_NIR16";
      break;
    case OusterProfile::kDual:
      text = "RNG19_RFL8_SIG16_NIR16_DUAL";
      break;
    case OusterProfile::kRng15:
      text = "RNG15_RFL8_NIR8";
      break;
    case OusterProfile::kRng15Dual:
      text = "RNG15_RFL8_NIR8_DUAL";
      break;
  }
  text += "; points in Ouster's sensor frame; a time per column on the sensor's clock";
  if (!metadata_.time_mode.empty()) text += " (" + metadata_.time_mode + ")";
  return text;
}

}  // namespace understory
