#include "understory/recording/captures/nmea.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "understory/recording/messages/event_bytes.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

constexpr std::size_t kLongestSentence = 1024;
using Line = std::array<char, kLongestSentence + 2>;
constexpr double kMetresPerSecondPerKnot = 1852.0 / 3600.0;

// The next line, cut where it is too long; false at the end.
bool next_line(std::istream& stream, Line& line, const std::string& source, std::uint64_t number) {
  const bool any = stream.getline(line.data(), line.size()) || stream.gcount() > 0;
  check_readable(stream, source, "line " + std::to_string(number));
  return any;
}

std::optional<double> number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::optional<int> digits(std::string_view text, std::size_t begin, std::size_t count) {
  if (text.size() < begin + count) return std::nullopt;
  int value = 0;
  for (const char c : text.substr(begin, count)) {
    if (c < '0' || c > '9') return std::nullopt;
    value = value * 10 + (c - '0');
  }
  return value;
}

// "hhmmss.sss"
std::optional<TimeNs> time_of_day(std::string_view text) {
  const auto hours = digits(text, 0, 2);
  const auto minutes = digits(text, 2, 2);
  const auto seconds = number(text.substr(std::min<std::size_t>(4, text.size())));
  if (!hours || !minutes || !seconds || *hours > 23 || *minutes > 59 || *seconds < 0.0 ||
      *seconds >= 61.0)
    return std::nullopt;
  return (*hours * 3600 + *minutes * 60) * kNsPerSecond + from_seconds(*seconds);
}

std::optional<std::int64_t> day_number(std::optional<int> year, std::optional<int> month,
                                       std::optional<int> day) {
  if (!year || !month || !day || *year < 1980 || *year > 2200) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(*year),
                                         std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok()) return std::nullopt;
  return std::chrono::sys_days(date).time_since_epoch().count();
}

// "ddmm.mmmm" or "dddmm.mmmm" and its hemisphere.
std::optional<double> angle(std::string_view text, std::string_view hemisphere, double limit_deg) {
  const auto value = number(text);
  if (!value || *value < 0.0 || hemisphere.size() != 1) return std::nullopt;
  const double whole = std::floor(*value / 100.0);
  const double minutes = *value - whole * 100.0;
  const double degrees = whole + minutes / 60.0;
  if (minutes >= 60.0 || degrees > limit_deg) return std::nullopt;
  const bool negative = hemisphere == "S" || hemisphere == "W";
  return negative ? -degrees : degrees;
}

// Field i, or empty beyond the last.
struct SentenceFields {
  std::vector<std::string_view> fields;
  std::string_view operator[](std::size_t i) const {
    return i < fields.size() ? fields[i] : std::string_view();
  }
  void position(std::size_t first, NmeaSentence& out) const {
    out.latitude_deg = angle((*this)[first], (*this)[first + 1], 90.0);
    out.longitude_deg = angle((*this)[first + 2], (*this)[first + 3], 180.0);
    if (!out.latitude_deg || !out.longitude_deg) out.latitude_deg = out.longitude_deg = {};
  }
};

void read_rmc(const SentenceFields& f, NmeaSentence& out) {
  out.time_of_day = time_of_day(f[1]);
  const auto year = digits(f[9], 4, 2);
  if (year) {
    out.day =
        day_number(*year + (*year < 80 ? 2000 : 1900), digits(f[9], 2, 2), digits(f[9], 0, 2));
  }
  if (f[2] != "A") {
    out.quality = 0;
    return;
  }
  f.position(3, out);
  if (const auto knots = number(f[7])) out.speed_m_s = *knots * kMetresPerSecondPerKnot;
  out.track_deg = number(f[8]);
  const std::string_view mode = f[12];
  out.quality = mode == "D" ? 2 : mode == "R" ? 4 : mode == "F" ? 5 : mode == "N" ? 0 : 1;
}

void read_altitude(const SentenceFields& f, std::size_t satellites, NmeaSentence& out) {
  if (const auto count = number(f[satellites]); count && *count >= 0.0 && *count < 1000.0)
    out.satellites = static_cast<int>(*count);
  out.hdop = number(f[satellites + 1]);
  out.altitude_m = number(f[satellites + 2]);
}

void read_gga(const SentenceFields& f, NmeaSentence& out) {
  out.time_of_day = time_of_day(f[1]);
  const auto quality = digits(f[6], 0, 1);
  out.quality = quality.value_or(0);
  if (*out.quality == 0) return;
  f.position(2, out);
  read_altitude(f, 7, out);
  out.geoid_separation_m = number(f[11]);
}

void read_gns(const SentenceFields& f, NmeaSentence& out) {
  out.time_of_day = time_of_day(f[1]);
  const std::string_view modes = f[6];
  const auto has = [&](char mode) { return modes.find(mode) != std::string_view::npos; };
  out.quality = has('R') ? 4 : has('F') ? 5 : has('D') ? 2 : has('A') ? 1 : 0;
  if (*out.quality == 0) return;
  f.position(2, out);
  read_altitude(f, 7, out);
  out.geoid_separation_m = number(f[10]);
}

// The last three values; newer versions of the standard put a system number behind them.
void read_gsa(const SentenceFields& f, NmeaSentence& out) {
  out.hdop = number(f[16]);
  out.vdop = number(f[17]);
}

void read_zda(const SentenceFields& f, NmeaSentence& out) {
  out.time_of_day = time_of_day(f[1]);
  out.day = day_number(digits(f[4], 0, 4), digits(f[3], 0, 2), digits(f[2], 0, 2));
}

// 0 to 360 degrees.
std::optional<double> heading(std::string_view text) {
  const auto degrees = number(text);
  if (!degrees || *degrees < 0.0 || *degrees > 360.0) return std::nullopt;
  return degrees;
}

void read_hdt(const SentenceFields& f, NmeaSentence& out) {
  if (f[2] == "T") out.heading_deg = heading(f[1]);
}

// Mode A: of the receiver itself, neither estimated, by hand, simulated nor invalid.
void read_ths(const SentenceFields& f, NmeaSentence& out) {
  if (f[2] == "A") out.heading_deg = heading(f[1]);
}

// $PSAT,HPR,time,heading,pitch,roll,type: by GNSS (N), not by the gyroscope (G).
void read_hpr(const SentenceFields& f, NmeaSentence& out) {
  out.time_of_day = time_of_day(f[2]);
  if (f[6] == "N") out.heading_deg = heading(f[3]);
}

// $PASHR,time,heading,T,roll,pitch,heave, their standard deviations (roll, pitch, heading), quality
// of GNSS (0: none), of the IMU. Other sentences of that name have no time there.
void read_hr(const SentenceFields& f, NmeaSentence& out) {
  const auto time = time_of_day(f[1]);
  if (!time || f[3] != "T") return;
  out.time_of_day = time;
  if (f[10] == "0") return;
  out.heading_deg = heading(f[2]);
  const auto sd = number(f[9]);
  if (out.heading_deg && sd && *sd > 0.0) out.heading_sd_deg = sd;
}

template <typename T>
void take(std::optional<T>& into, const std::optional<T>& from) {
  if (from) into = from;
}

void put_sentence(BinaryWriter& writer, const NmeaSentence& sentence) {
  writer.put(sentence.type);
  for (const auto* value : {&sentence.time_of_day, &sentence.day})
    put_optional(writer, *value);
  for (const auto* value : {&sentence.quality, &sentence.satellites})
    put_optional(writer, *value);
  for (const auto* value :
       {&sentence.latitude_deg, &sentence.longitude_deg, &sentence.altitude_m,
        &sentence.geoid_separation_m, &sentence.hdop, &sentence.vdop, &sentence.track_deg,
        &sentence.speed_m_s, &sentence.heading_deg, &sentence.heading_sd_deg})
    put_optional(writer, *value);
}

NmeaSentence get_sentence(BinaryReader& reader) {
  NmeaSentence sentence;
  sentence.type = reader.get_string();
  for (auto* value : {&sentence.time_of_day, &sentence.day})
    *value = get_optional<std::int64_t>(reader);
  for (auto* value : {&sentence.quality, &sentence.satellites})
    *value = get_optional<int>(reader);
  for (auto* value :
       {&sentence.latitude_deg, &sentence.longitude_deg, &sentence.altitude_m,
        &sentence.geoid_separation_m, &sentence.hdop, &sentence.vdop, &sentence.track_deg,
        &sentence.speed_m_s, &sentence.heading_deg, &sentence.heading_sd_deg})
    *value = get_optional<double>(reader);
  return sentence;
}

// A heading that was computed for an epoch before the one that is being read.
bool is_late_heading(const NmeaSentence& sentence, const std::optional<NmeaSentence>& epoch) {
  if (sentence.type != "HPR" && sentence.type != "SHR") return false;
  if (!sentence.time_of_day || !epoch || !epoch->time_of_day) return false;
  const TimeNs behind = *epoch->time_of_day - *sentence.time_of_day;
  return behind > 0 ? behind < kNsPerDay / 2 : behind < -kNsPerDay / 2;
}

void merge(NmeaSentence& epoch, const NmeaSentence& more) {
  take(epoch.day, more.day);
  take(epoch.satellites, more.satellites);
  take(epoch.hdop, more.hdop);
  take(epoch.vdop, more.vdop);
  take(epoch.track_deg, more.track_deg);
  take(epoch.speed_m_s, more.speed_m_s);
  if (more.heading_deg) {  // with what is said of it
    epoch.heading_deg = more.heading_deg;
    epoch.heading_sd_deg = more.heading_sd_deg;
  }
  take(epoch.altitude_m, more.altitude_m);
  take(epoch.geoid_separation_m, more.geoid_separation_m);
  // A position that comes with a height is preferred, because both are then of one solution.
  if (!epoch.latitude_deg || more.altitude_m) {
    take(epoch.latitude_deg, more.latitude_deg);
    take(epoch.longitude_deg, more.longitude_deg);
  }
  if (more.quality && *more.quality > epoch.quality.value_or(0)) epoch.quality = more.quality;
}

}  // namespace

std::optional<NmeaSentence> parse_nmea(std::string_view line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == '\n' || line.back() == ' '))
    line.remove_suffix(1);
  const std::size_t begin = line.find('$');
  if (begin == std::string_view::npos || line.size() > kLongestSentence) return std::nullopt;
  std::string_view body = line.substr(begin + 1);
  if (const std::size_t star = body.find('*'); star != std::string_view::npos) {
    unsigned stated = 0;
    const std::string_view hex = body.substr(star + 1);
    const auto [end, error] = std::from_chars(hex.data(), hex.data() + hex.size(), stated, 16);
    body = body.substr(0, star);
    unsigned sum = 0;
    for (const char c : body)
      sum ^= static_cast<unsigned char>(c);
    if (error != std::errc() || end != hex.data() + 2 || hex.size() != 2 || stated != sum)
      return std::nullopt;
  }
  const SentenceFields fields{split(body, ",", false)};
  if (fields[0].size() < 4) return std::nullopt;
  NmeaSentence out;
  if (fields[0] == "PSAT") {
    out.type = fields[1];
    if (out.type == "HPR") read_hpr(fields, out);
    return out;
  }
  if (fields[0].size() < 5) return std::nullopt;
  out.type = fields[0].substr(fields[0].size() - 3);
  if (out.type == "RMC") read_rmc(fields, out);
  if (out.type == "GGA") read_gga(fields, out);
  if (out.type == "GNS") read_gns(fields, out);
  if (out.type == "GSA") read_gsa(fields, out);
  if (out.type == "ZDA") read_zda(fields, out);
  if (out.type == "HDT") read_hdt(fields, out);
  if (out.type == "THS") read_ths(fields, out);
  if (fields[0] == "PASHR") read_hr(fields, out);
  return out;
}

GnssFix nmea_fix(const NmeaSentence& sentence, TimeNs stamp) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  GnssFix fix;
  fix.stamp = stamp;
  fix.latitude_deg = sentence.latitude_deg.value_or(kUnknown);
  fix.longitude_deg = sentence.longitude_deg.value_or(kUnknown);
  fix.height_m = sentence.altitude_m.value_or(kUnknown) + sentence.geoid_separation_m.value_or(0.0);
  fix.quality = sentence.quality.value_or(0);
  fix.satellites = sentence.satellites.value_or(-1);
  fix.hdop = sentence.hdop.value_or(kUnknown);
  fix.vdop = sentence.vdop.value_or(kUnknown);
  fix.track_deg = sentence.track_deg.value_or(kUnknown);
  fix.speed_m_s = sentence.speed_m_s.value_or(kUnknown);
  fix.heading_deg = sentence.heading_deg.value_or(kUnknown);
  fix.heading_sd_deg = sentence.heading_sd_deg.value_or(kUnknown);
  return fix;
}

std::string nmea_heading(const GnssFix& fix) {
  const TimeNs of_day = ((fix.stamp % kNsPerDay) + kNsPerDay) % kNsPerDay;
  const auto seconds = static_cast<int>(of_day / kNsPerSecond);
  const auto microseconds = static_cast<int>(of_day % kNsPerSecond / 1000);
  const int quality = fix.quality == 4 || fix.quality == 5 ? 2 : 1;
  char text[160];
  std::snprintf(text, sizeof text, "$PASHR,%02d%02d%02d.%06d,%.4f,T,,,,,,", seconds / 3600,
                seconds / 60 % 60, seconds % 60, microseconds, fix.heading_deg);
  std::string sentence = text;
  if (std::isfinite(fix.heading_sd_deg)) {
    std::snprintf(text, sizeof text, "%.4f", fix.heading_sd_deg);
    sentence += text;
  }
  sentence += "," + std::to_string(quality) + ",0";
  unsigned sum = 0;
  for (const char c : sentence.substr(1))
    sum ^= static_cast<unsigned char>(c);
  std::snprintf(text, sizeof text, "*%02X", sum);
  return sentence + text;
}

NmeaLogReader::NmeaLogReader(std::istream& stream, std::string source, std::int64_t first_day,
                             Log& log)
    : stream_(stream), source_(std::move(source)), log_(log), day_(first_day) {}

std::optional<GnssFix> NmeaLogReader::next() {
  Line line{};
  while (next_line(stream_, line, source_, line_number_ + 1)) {
    ++line_number_;
    const std::string_view text(line.data());
    if (stream_.fail()) stream_.clear(stream_.rdstate() & ~std::ios::failbit);
    if (text.find('$') == std::string_view::npos) continue;
    const auto sentence = parse_nmea(text);
    if (!sentence) {
      log_.warn("recording.damaged_line",
                source_ + ": line " + std::to_string(line_number_) +
                    ": not an NMEA sentence with a right checksum, left out");
      continue;
    }
    if (auto fix = add(*sentence)) return fix;
  }
  return close_epoch();
}

void NmeaLogReader::save(BinaryWriter& writer) const {
  // At the end of the stream it has no position.
  writer.put(stream_.eof() ? std::int64_t{-1} : static_cast<std::int64_t>(stream_.tellg()));
  writer.put(day_);
  writer.put(last_time_of_day_);
  writer.put(line_number_);
  writer.put(epoch_.has_value());
  if (epoch_) put_sentence(writer, *epoch_);
}

void NmeaLogReader::load(BinaryReader& reader) {
  const auto position = reader.get<std::int64_t>();
  stream_.clear();
  if (position < 0) {
    stream_.setstate(std::ios::eofbit);
  } else {
    stream_.seekg(position);
  }
  day_ = reader.get<std::int64_t>();
  last_time_of_day_ = reader.get<TimeNs>();
  line_number_ = reader.get<std::uint64_t>();
  epoch_.reset();
  if (reader.get<bool>()) epoch_ = get_sentence(reader);
}

std::optional<GnssFix> NmeaLogReader::add(const NmeaSentence& sentence) {
  std::optional<GnssFix> finished;
  if (is_late_heading(sentence, epoch_)) return finished;
  const bool new_epoch = sentence.time_of_day && (!epoch_ || !epoch_->time_of_day ||
                                                  *sentence.time_of_day != *epoch_->time_of_day);
  if (new_epoch && epoch_ && epoch_->time_of_day) {
    finished = close_epoch();
  }
  if (!epoch_) epoch_.emplace();
  if (sentence.time_of_day) epoch_->time_of_day = sentence.time_of_day;
  merge(*epoch_, sentence);
  return finished;
}

std::optional<GnssFix> NmeaLogReader::close_epoch() {
  if (!epoch_) return std::nullopt;
  const NmeaSentence epoch = *epoch_;
  epoch_.reset();
  if (!epoch.time_of_day) return std::nullopt;
  if (epoch.day) {
    day_ = *epoch.day;
  } else if (day_ >= 0 && last_time_of_day_ - *epoch.time_of_day > kNsPerDay / 2) {
    ++day_;  // midnight passed since the last dated epoch
  }
  last_time_of_day_ = *epoch.time_of_day;
  if (!epoch.latitude_deg) return std::nullopt;
  if (day_ < 0) {
    log_.warn("recording.gnss_date", source_ + ": line " + std::to_string(line_number_) +
                                         ": a position without a date (no RMC or ZDA sentence), "
                                         "left out");
    return std::nullopt;
  }
  return nmea_fix(epoch, day_ * kNsPerDay + *epoch.time_of_day);
}

std::int64_t first_nmea_day(std::istream& stream, const std::string& source) {
  Line line{};
  TimeNs first_time = -1;
  for (std::uint64_t number = 1; next_line(stream, line, source, number); ++number) {
    if (stream.fail()) stream.clear(stream.rdstate() & ~std::ios::failbit);
    const auto sentence = parse_nmea(line.data());
    if (!sentence || !sentence->time_of_day) continue;
    if (first_time < 0) first_time = *sentence->time_of_day;
    if (sentence->day) return *sentence->day - (*sentence->time_of_day < first_time ? 1 : 0);
  }
  return -1;
}

}  // namespace understory
