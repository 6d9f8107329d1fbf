#include "understory/recording/captures/rtklib.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>

#include "understory/util/error.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

constexpr TimeNs kGpsEpochNs = 3'657 * kNsPerDay;  // 1980-01-06
constexpr std::size_t kLongestRow = 1024;

enum class Places { kDegrees, kDegreesMinutes, kEarthCentred };

// What the header says of the rows.
struct SolutionFormat {
  Places places = Places::kDegrees;
  double ahead_of_utc_s = 0.0;  // JST
  bool gps_time = true;
  bool geoid_heights = false;
  bool baselines = false;
};

// Days since 1970 from which GPS time is ahead of UTC by one second more than before; 1981 to 2017.
constexpr std::array<int, 18> kLeapDays{4'199,  4'564,  4'929,  5'660,  6'574,  7'305,
                                        7'670,  8'217,  8'582,  8'947,  9'496,  10'043,
                                        10'592, 13'149, 14'245, 15'522, 16'617, 17'167};

TimeNs utc_from_gps(TimeNs gps) {
  TimeNs ahead = 0;
  for (const int day : kLeapDays) {
    if (gps - ahead - kNsPerSecond >= day * kNsPerDay) ahead += kNsPerSecond;
  }
  return gps - ahead;
}

void learn(const std::string& line, SolutionFormat& format) {
  const auto has = [&](const char* word) { return line.find(word) != std::string::npos; };
  if (has("height=") && has("/geodetic")) format.geoid_heights = true;
  if (has("x-ecef")) format.places = Places::kEarthCentred;
  if (has("latitude(d'")) format.places = Places::kDegreesMinutes;
  if (has("e-baseline")) format.baselines = true;
  if (!has("latitude") && !has("x-ecef") && !has("e-baseline")) return;
  // The line of the columns begins with the name of the clock.
  format.gps_time = has("GPST") || !(has("UTC") || has("JST"));
  format.ahead_of_utc_s = has("JST") ? 9.0 * 3600.0 : 0.0;
}

// "2019/08/10" and "08:30:00.000", or GPS week and second of the week.
std::optional<TimeNs> time_of(std::string_view first, std::string_view second) {
  const auto day = split(first, "/", false);
  if (day.size() == 1) {
    const auto week = to_count(first);
    const auto seconds = to_number(second);
    if (!week || !seconds || *week > 10'000 || !(*seconds >= 0.0) || *seconds > 604'800.0)
      return std::nullopt;
    return kGpsEpochNs + static_cast<TimeNs>(*week) * 7 * kNsPerDay + from_seconds(*seconds);
  }
  const auto clock = split(second, ":", false);
  if (day.size() != 3 || clock.size() != 3) return std::nullopt;
  const auto year = to_count(day[0]);
  const auto month = to_count(day[1]);
  const auto date = to_count(day[2]);
  const auto hours = to_count(clock[0]);
  const auto minutes = to_count(clock[1]);
  const auto seconds = to_number(clock[2]);
  if (!year || !month || !date || !hours || !minutes || !seconds || *year < 1980 || *year > 2200 ||
      *month > 12 || *date > 31 || *hours > 23 || *minutes > 59 || !(*seconds >= 0.0) ||
      *seconds >= 61.0)
    return std::nullopt;
  const std::chrono::year_month_day ymd{std::chrono::year(static_cast<int>(*year)),
                                        std::chrono::month(static_cast<unsigned>(*month)),
                                        std::chrono::day(static_cast<unsigned>(*date))};
  if (!ymd.ok()) return std::nullopt;
  const auto days = std::chrono::sys_days(ymd).time_since_epoch().count();
  return days * kNsPerDay + static_cast<TimeNs>(*hours * 3600 + *minutes * 60) * kNsPerSecond +
         from_seconds(*seconds);
}

double angle_of(double degrees, double minutes, double seconds) {
  const double size = std::abs(degrees) + minutes / 60.0 + seconds / 3600.0;
  return std::signbit(degrees) ? -size : size;
}

// WGS 84 latitude, longitude (degrees) and height from earth-centred metres.
void set_from_earth_centred(double x, double y, double z, GnssFix& fix) {
  constexpr double kSemiMajor = 6378137.0;
  constexpr double kEccentricity2 = 6.69437999014131e-3;
  const double plane = std::hypot(x, y);
  double latitude = std::atan2(z, plane * (1.0 - kEccentricity2));
  double height = 0.0;
  for (int step = 0; step < 6; ++step) {
    const double s = std::sin(latitude);
    const double n = kSemiMajor / std::sqrt(1.0 - kEccentricity2 * s * s);
    height = plane * std::cos(latitude) + z * s - n * (1.0 - kEccentricity2 * s * s);
    latitude = std::atan2(z, plane * (1.0 - kEccentricity2 * n / (n + height)));
  }
  fix.latitude_deg = latitude * 180.0 / M_PI;
  fix.longitude_deg = std::atan2(y, x) * 180.0 / M_PI;
  fix.height_m = height;
}

// Variances and signed roots of covariances: north, east, up, north-east, east-up, up-north.
Eigen::Matrix3d covariance_of(const std::vector<double>& sd, std::size_t first) {
  const auto covariance = [&](std::size_t k) { return sd[first + k] * std::abs(sd[first + k]); };
  Eigen::Matrix3d c;
  c(0, 0) = covariance(1);
  c(1, 1) = covariance(0);
  c(2, 2) = covariance(2);
  c(0, 1) = c(1, 0) = covariance(3);
  c(0, 2) = c(2, 0) = covariance(4);
  c(1, 2) = c(2, 1) = covariance(5);
  return c;
}

// RTKLIB: 1 fixed, 2 float, 3 SBAS, 4 differential, 5 single, 6 precise point positioning.
int quality_of(double q) {
  constexpr std::array<int, 7> kQualities{0, 4, 5, 2, 2, 1, 1};
  return q >= 0.0 && q < 7.0 ? kQualities[static_cast<std::size_t>(q)] : 0;
}

std::optional<GnssFix> row_of(const std::string& line, const SolutionFormat& format) {
  const auto cells = split(line, " \t,;", true);
  std::vector<double> values;
  for (std::size_t k = 2; k < cells.size(); ++k) {
    const auto value = to_number(cells[k]);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  const std::size_t place = format.places == Places::kDegreesMinutes ? 7 : 3;
  if (values.size() < place) return std::nullopt;
  const auto stamp = time_of(cells[0], cells[1]);
  if (!stamp) return std::nullopt;
  GnssFix fix;
  fix.stamp = format.gps_time ? utc_from_gps(*stamp) : *stamp - from_seconds(format.ahead_of_utc_s);
  if (format.places == Places::kEarthCentred) {
    set_from_earth_centred(values[0], values[1], values[2], fix);
  } else if (format.places == Places::kDegreesMinutes) {
    fix.latitude_deg = angle_of(values[0], values[1], values[2]);
    fix.longitude_deg = angle_of(values[3], values[4], values[5]);
    fix.height_m = values[6];
  } else {
    fix.latitude_deg = values[0];
    fix.longitude_deg = values[1];
    fix.height_m = values[2];
  }
  if (!std::isfinite(fix.height_m) || !(std::abs(fix.latitude_deg) <= 90.0) ||
      !(std::abs(fix.longitude_deg) <= 360.0))
    return std::nullopt;
  if (values.size() >= place + 2) {
    fix.quality = quality_of(values[place]);
    const double satellites = values[place + 1];
    if (satellites >= 0.0 && satellites < 1000.0) fix.satellites = static_cast<int>(satellites);
  }
  // The columns are those of the earth's axes there, which are not kept.
  if (values.size() >= place + 8 && format.places != Places::kEarthCentred)
    fix.covariance = covariance_of(values, place + 2);
  return fix;
}

}  // namespace

std::vector<GnssFix> read_rtklib_solution(std::istream& stream, const std::string& source,
                                          Log& log) {
  SolutionFormat format;
  std::vector<GnssFix> fixes;
  std::string line;
  for (std::uint64_t number = 1; read_line(stream, line, source, number); ++number) {
    const std::string_view text = trimmed(line);
    if (text.empty()) continue;
    if (text.front() == '%') {
      learn(line, format);
      continue;
    }
    if (format.baselines)
      throw InputError(source, "line " + std::to_string(number),
                       "expected positions: these are baselines to a base station (option outpos)");
    auto fix = line.size() > kLongestRow ? std::nullopt : row_of(std::string(text), format);
    if (fix) {
      fixes.push_back(*fix);
    } else {
      log.warn("recording.damaged_line", source + ": line " + std::to_string(number) +
                                             ": no position of an RTKLIB solution, left out");
    }
  }
  if (format.geoid_heights && !fixes.empty())
    log.warn("recording.geoid_heights",
             source + ": heights are above the geoid and not above the ellipsoid, by the header");
  return fixes;
}

std::vector<GnssFix> read_rtklib_solution(const std::string& file, Log& log) {
  std::ifstream stream(file, std::ios::binary);
  return read_rtklib_solution(stream, file, log);
}

bool is_rtklib_solution(const std::string& file) {
  if (file.ends_with(".pos")) return true;
  std::ifstream stream(file, std::ios::binary);
  std::string line(2 * kLongestRow, '\0');
  stream.read(line.data(), static_cast<std::streamsize>(line.size()));
  line.resize(static_cast<std::size_t>(stream.gcount()));
  return line.starts_with('%') &&
         (line.find("RTKLIB") != std::string::npos || line.find("latitude(") != std::string::npos);
}

}  // namespace understory
