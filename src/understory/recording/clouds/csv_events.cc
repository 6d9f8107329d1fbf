#include "understory/recording/clouds/csv_events.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostColumns = 256;
constexpr std::uint64_t kBeyondSeconds = 100'000'000'000;

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

}  // namespace

CsvRows::CsvRows(std::unique_ptr<ByteSource> file, Log& log)
    : file_(std::move(file)), lines_(*file_), log_(log) {
  std::string_view line;
  while (lines_.next(line)) {
    if (line.empty() || line.front() == '#') {
      // "# timestamp,gx,..." is a header as well.
      if (line.find(',') == std::string_view::npos) continue;
      line.remove_prefix(1);
    }
    break;
  }
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (line.rfind(kByteOrderMark, 0) == 0) line.remove_prefix(kByteOrderMark.size());
  for (const std::string_view cell : split_cells(line, ',')) {
    if (names_.size() == kMostColumns) break;
    names_.push_back(lower(cell));
    columns_.emplace(names_.back(), names_.size() - 1);
  }
}

std::optional<std::size_t> CsvRows::find(const std::vector<std::string>& names) const {
  for (const std::string& name : names) {
    const auto column = columns_.find(name);
    if (column != columns_.end()) return column->second;
  }
  return std::nullopt;
}

std::size_t CsvRows::require(const std::vector<std::string>& names) const {
  if (const auto column = find(names)) return *column;
  throw InputError(file_->name(), "line 1", "expected a header with the column " + names.front());
}

bool CsvRows::next() {
  std::string_view line;
  while (lines_.next(line)) {
    if (line.empty() || line.front() == '#') continue;
    const std::vector<std::string_view> cells = split_cells(line, ',');
    if (cells.size() < names_.size()) {
      damaged("expected " + std::to_string(names_.size()) + " cells, found " +
              std::to_string(cells.size()));
      continue;
    }
    cells_.assign(cells.begin(), cells.begin() + static_cast<std::ptrdiff_t>(names_.size()));
    return true;
  }
  return false;
}

double CsvRows::number(std::size_t column) const {
  return to_number(cells_[column]).value_or(kUnknown);
}

std::optional<TimeNs> CsvRows::time(std::size_t column) const {
  const std::string& text = cells_[column];
  const std::string& name = names_[column];
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

void CsvRows::damaged(const std::string& what) {
  log_.warn("recording.damaged_line",
            file_->name() + ": line " + std::to_string(lines_.number()) + ": " + what);
}

void CsvRows::save(BinaryWriter& writer) const {
  writer.put(lines_.position());
  writer.put(lines_.number());
}

void CsvRows::load(BinaryReader& reader) {
  const auto position = reader.get<std::uint64_t>();
  lines_.go_to(position, reader.get<std::uint64_t>());
}

CsvImuReader::CsvImuReader(std::unique_ptr<ByteSource> file, Log& log)
    : rows_(std::move(file), log) {
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

CsvGnssReader::CsvGnssReader(std::unique_ptr<ByteSource> file, Log& log)
    : rows_(std::move(file), log) {
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
