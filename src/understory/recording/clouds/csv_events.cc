#include "understory/recording/clouds/csv_events.h"

#include <cmath>
#include <limits>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint64_t kBeyondSeconds = 100'000'000'000;

}  // namespace

EventRows::EventRows(const std::filesystem::path& path, Log& log)
    : log_(log),
      table_(path, {},
             {.any_case = true,
              .header_in_comment = true,
              .on_short_row = [this](const std::string& problem) { damaged(problem); }}) {}

double EventRows::number(std::size_t column) const {
  return to_number(table_.text(column)).value_or(kUnknown);
}

std::optional<TimeNs> EventRows::time(std::size_t column) const {
  const std::string text(table_.text(column));
  const std::string& name = table_.names()[column];
  const auto whole = to_count(text);
  const bool says_ns = name.size() > 3 && name.compare(name.size() - 3, 3, "_ns") == 0;
  if (whole && (says_ns || *whole > kBeyondSeconds))
    return *whole <= static_cast<std::uint64_t>(INT64_MAX)
               ? std::optional(static_cast<TimeNs>(*whole))
               : std::nullopt;
  TimeNs time = 0;
  if (parse_seconds(text, time)) return time;
  const auto value = to_number(text);
  if (!value || !(std::abs(*value) < 9e9)) return std::nullopt;
  return from_seconds(*value);
}

void EventRows::damaged(const std::string& what) {
  ++unreadable_;
  log_.warn("recording.damaged_line",
            table_.lines().file() + ": " + table_.lines().position() + ": " + what);
}

CsvImuReader::CsvImuReader(const std::filesystem::path& path, Log& log) : rows_(path, log) {
  time_ = rows_.require({"timestamp", "time", "t", "timestamp_ns", "timestamp_s", "stamp"});
  const char* axes[] = {"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string axis = axes[i];
    rate_[i] = rows_.require({"g" + axis, "w" + axis, "gyro_" + axis, "angular_velocity_" + axis});
    force_[i] =
        rows_.require({"a" + axis, "acc_" + axis, "accel_" + axis, "linear_acceleration_" + axis});
  }
}

std::optional<ImuSample> CsvImuReader::next() {
  while (rows_.next()) {
    ImuSample sample;
    const auto time = rows_.time(time_);
    for (int i = 0; i < 3; ++i) {
      sample.angular_rate[i] = rows_.number(rate_[i]);
      sample.specific_force[i] = rows_.number(force_[i]);
    }
    if (time && sample.angular_rate.allFinite() && sample.specific_force.allFinite()) {
      sample.stamp = *time;
      return sample;
    }
    rows_.damaged("expected a time and six numbers");
  }
  return std::nullopt;
}

CsvGnssReader::CsvGnssReader(const std::filesystem::path& path, Log& log) : rows_(path, log) {
  time_ = rows_.require({"timestamp", "time", "t", "timestamp_ns", "timestamp_s", "stamp"});
  latitude_ = rows_.require({"latitude_deg", "latitude", "lat"});
  longitude_ = rows_.require({"longitude_deg", "longitude", "lon"});
  height_ = rows_.require({"height_m", "height", "altitude_m", "altitude", "alt"});
  hdop_ = rows_.find({"hdop"});
  vdop_ = rows_.find({"vdop"});
  satellites_ = rows_.find({"satellites"});
  quality_ = rows_.find({"quality"});
  track_ = rows_.find({"track_deg"});
  speed_ = rows_.find({"speed_m_s"});
  heading_ = rows_.find({"heading_deg"});
  heading_sd_ = rows_.find({"heading_sd_deg"});
  sd_[0] = rows_.find({"sd_east_m"});
  sd_[1] = rows_.find({"sd_north_m"});
  sd_[2] = rows_.find({"sd_up_m"});
}

double CsvGnssReader::optional_number(const std::optional<std::size_t>& column) const {
  return column ? rows_.number(*column) : kUnknown;
}

std::optional<GnssFix> CsvGnssReader::next() {
  while (rows_.next()) {
    GnssFix fix;
    const auto time = rows_.time(time_);
    fix.latitude_deg = rows_.number(latitude_);
    fix.longitude_deg = rows_.number(longitude_);
    fix.height_m = rows_.number(height_);
    if (!time || !(std::abs(fix.latitude_deg) <= 90.0) || !(std::abs(fix.longitude_deg) <= 360.0)) {
      rows_.damaged("expected a time, a latitude and a longitude");
      continue;
    }
    fix.stamp = *time;
    fix.hdop = optional_number(hdop_);
    fix.vdop = optional_number(vdop_);
    fix.track_deg = optional_number(track_);
    fix.speed_m_s = optional_number(speed_);
    fix.heading_deg = optional_number(heading_);
    fix.heading_sd_deg = optional_number(heading_sd_);
    const double satellites = optional_number(satellites_);
    const double quality = optional_number(quality_);
    if (satellites >= 0.0 && satellites < 1000.0) fix.satellites = static_cast<int>(satellites);
    fix.quality = quality >= 0.0 && quality < 10.0 ? static_cast<int>(quality) : 1;
    const Eigen::Vector3d sd(optional_number(sd_[0]), optional_number(sd_[1]),
                             optional_number(sd_[2]));
    if (sd.allFinite()) fix.covariance = sd.cwiseAbs2().asDiagonal();
    return fix;
  }
  return std::nullopt;
}

}  // namespace understory
