#include "understory/recording/captures/hesai/hesai.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/finding.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr TimeNs kLongestTurn = kNsPerSecond / 2;
constexpr std::uint32_t kMostLost = 100'000;  // packets; a larger step is a sensor that restarted
constexpr double kTurnDeg = 360.0;

template <typename T>
T number_at(ByteSpan bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

// Days since 1970 of a date of the civil calendar (years that begin in March).
std::int64_t days_of(std::int64_t year, std::int64_t month, std::int64_t day) {
  const std::int64_t y = month <= 2 ? year - 1 : year;
  const std::int64_t era = (y >= 0 ? y : y - 399) / 400;
  const std::int64_t of_era = y - era * 400;
  const std::int64_t of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  return era * 146'097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719'468;
}

// Six bytes: year, month, day, hour, minute, second. The year counts from 1900 (70 and more) or
// from 2000. With a year of 0 the other five are seconds since 1970, big-endian.
std::optional<TimeNs> date_of(const std::uint8_t* raw) {
  if (raw[0] == 0) {
    TimeNs seconds = 0;
    for (int i = 1; i < 6; ++i)
      seconds = seconds * 256 + raw[i];
    if (seconds > 4'000'000'000) return std::nullopt;
    return seconds * kNsPerSecond;
  }
  if (raw[1] < 1 || raw[1] > 12 || raw[2] < 1 || raw[2] > 31 || raw[3] > 23 || raw[4] > 59 ||
      raw[5] > 60)
    return std::nullopt;
  const int year = raw[0] >= 70 ? 1900 + raw[0] : 2000 + raw[0];
  return ((days_of(year, raw[1], raw[2]) * 24 + raw[3]) * 60 + raw[4]) * 60 * kNsPerSecond +
         raw[5] * kNsPerSecond;
}

// 0 where the mode is not known.
std::size_t returns_of(std::uint8_t mode) {
  switch (mode) {
    case 0x33:
    case 0x34:
    case 0x37:
    case 0x38:
      return 1;
    case 0x39:
    case 0x3A:
    case 0x3B:
    case 0x3C:
      return 2;
    default:
      return 0;
  }
}

std::string hex(unsigned value) {
  constexpr const char* kDigits = "0123456789ABCDEF";
  return std::string("0x") + kDigits[value / 16 % 16] + kDigits[value % 16];
}

}  // namespace

HesaiDecoder::HesaiDecoder(HesaiConfig config, std::string source, Log& log)
    : config_(std::move(config)), source_(source), log_(log), finished_(std::move(source), log) {}

void HesaiDecoder::damaged(const std::string& what) {
  report_finding(log_, Finding::kDamagedPacket,
                 source_ + ": Hesai packet " + std::to_string(received_) + ": " + what);
}

void HesaiDecoder::add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp) {
  ++received_;
  const ByteSpan packet(data, size);
  if (!accept_model(packet) || !accept_sequence(packet)) return;
  const std::size_t tail = table_.tail_begin();
  const std::uint8_t mode = packet[tail + table_.mode_at];
  const std::size_t returns = returns_of(mode);
  if (returns == 0) {
    damaged("its return mode " + hex(mode) +
            " is not known: single (0x33, 0x34, 0x37, 0x38) and "
            "dual (0x39 to 0x3C) are read");
    return;
  }
  const auto date = date_of(packet.data() + tail + table_.date_at);
  const auto microseconds = number_at<std::uint32_t>(packet, tail + table_.microseconds_at);
  const auto time =
      date ? clock_.time(*date + static_cast<TimeNs>(microseconds) * 1000, stamp) : std::nullopt;
  if (!time) {
    damaged("its time does not follow the one before");
    return;
  }
  return_mode_ = mode;
  const auto rpm = number_at<std::uint16_t>(packet, tail + table_.motor_at);
  if (!config_.calibration.firing_us.empty()) set_turn(6e-6 * rpm);
  decode_blocks(packet, returns, *time);
}

// The model is that of the first packet; a packet that contradicts it is taken as damaged unless
// the next one says the same.
bool HesaiDecoder::accept_model(ByteSpan packet) {
  const HesaiKind kind = hesai_kind(packet);
  if (kind.model == HesaiModel::kUnknown) {
    damaged("is of " + kind.other + ": PandarXT-32, PandarXT-16, Pandar64 and PandarQT64 are read");
    return false;
  }
  if (kind.model != model_ && model_ != HesaiModel::kUnknown && contradicting_ != kind.model) {
    contradicting_ = kind.model;
    damaged("another sensor model than before");
    return false;
  }
  contradicting_ = HesaiModel::kUnknown;
  if (kind.model == model_) return is_whole(packet, table_);
  if (!is_whole(packet, hesai_table(kind.model))) return false;
  set_model(kind.model);
  if (config_.calibration.elevation_deg.empty())
    log_.warn("recording.no_calibration",
              source_ + ": no angle correction file of this " + table_.name +
                  ": the angles of its design are used, which may be wrong by tenths of a degree. "
                  "Give the sensor's file with --metadata FILE.csv");
  return true;
}

bool HesaiDecoder::is_whole(ByteSpan packet, const HesaiTable& table) {
  const bool numbered = (packet[table.flags_at] & 1) != 0;
  const std::size_t expected = table.tail_begin() + table.tail_bytes + (numbered ? 4 : 0);
  if (packet.size() >= expected) return true;
  damaged("has " + std::to_string(packet.size()) + " bytes, expected " + std::to_string(expected));
  return false;
}

bool HesaiDecoder::accept_sequence(ByteSpan packet) {
  unit_m_ = 0.001 * packet[table_.header_bytes == 8 ? 5 : 9];
  if ((packet[table_.flags_at] & 1) == 0) return true;
  const auto number = number_at<std::uint32_t>(packet, table_.tail_begin() + table_.tail_bytes);
  const std::optional<std::uint32_t> before = std::exchange(sequence_, number);
  if (!before) return true;
  const std::uint32_t step = number - *before;
  if (step == 0) {
    damaged("comes twice (sequence number " + std::to_string(number) + ")");
    return false;
  }
  if (step > 1 && step < kMostLost)
    damaged(std::to_string(step - 1) + " packets before it are missing");
  return true;
}

void HesaiDecoder::set_model(HesaiModel model) {
  close_scan();
  model_ = model;
  table_ = hesai_table(model);
  sequence_.reset();
  const HesaiCalibration& own = config_.calibration;
  const auto check = [&](const std::string& file, std::size_t count) {
    if (count == 0 || count == table_.channels) return;
    throw InputError(file, "",
                     "has " + std::to_string(count) + " channels, but " + source_ + " is of a " +
                         table_.name + " with " + std::to_string(table_.channels));
  };
  check(own.angles_file, own.elevation_deg.size());
  check(own.firing_file, own.firing_us.size());
  if (!own.elevation_deg.empty()) {
    table_.elevation_deg = own.elevation_deg;
    table_.azimuth_deg = own.azimuth_deg;
  }
  if (!own.firing_us.empty()) table_.firing_us = own.firing_us;
  std::vector<double> sorted = table_.elevation_deg;
  std::sort(sorted.begin(), sorted.end());
  beams_.assign(table_.channels, Beam());
  for (std::size_t i = 0; i < table_.channels; ++i) {
    const double elevation = table_.elevation_deg[i];
    beams_[i].cos_elevation = std::cos(elevation * kDegree);
    beams_[i].sin_elevation = std::sin(elevation * kDegree);
    beams_[i].firing_ns = std::llround(table_.firing_us[i] * 1000.0);
    beams_[i].ring = static_cast<std::uint16_t>(
        std::lower_bound(sorted.begin(), sorted.end(), elevation) - sorted.begin());
  }
  degrees_per_us_ = -1.0;
  set_turn(0.0);
}

// Sines and cosines of the azimuths are made once for a rate, and added to that of the block.
void HesaiDecoder::set_turn(double degrees_per_us) {
  if (degrees_per_us == degrees_per_us_) return;
  degrees_per_us_ = degrees_per_us;
  for (std::size_t i = 0; i < beams_.size(); ++i) {
    const double azimuth = (table_.azimuth_deg[i] + degrees_per_us * table_.firing_us[i]) * kDegree;
    beams_[i].cos_azimuth = std::cos(azimuth);
    beams_[i].sin_azimuth = std::sin(azimuth);
  }
}

TimeNs HesaiDecoder::firing_time(TimeNs packet, std::size_t block, std::size_t returns) const {
  const std::size_t firing = block / returns;
  const double steps = table_.time_of_last
                           ? -static_cast<double>(table_.blocks / returns - 1 - firing)
                           : static_cast<double>(firing);
  return packet + std::llround((table_.offset_us + steps * table_.block_us) * 1000.0);
}

void HesaiDecoder::decode_blocks(ByteSpan packet, std::size_t returns, TimeNs time) {
  std::size_t bad = 0;
  for (std::size_t block = 0; block + returns <= table_.blocks; block += returns) {
    const std::size_t at = table_.header_bytes + block * table_.block_bytes();
    const auto azimuth = number_at<std::uint16_t>(packet, at);
    Firing firing;
    firing.first = packet.data() + at + 2;
    if (returns == 2) firing.second = firing.first + table_.block_bytes();
    const bool same =
        returns == 1 || number_at<std::uint16_t>(packet, at + table_.block_bytes()) == azimuth;
    if (azimuth >= 36'000 || !same) {
      ++bad;
      continue;
    }
    firing.time = firing_time(time, block, returns);
    firing.cosine = std::cos(azimuth * 0.01 * kDegree);
    firing.sine = std::sin(azimuth * 0.01 * kDegree);
    turn_to(azimuth * 0.01, firing.time + beams_.front().firing_ns);
    decode_firing(firing);
  }
  if (bad > 0)
    damaged(std::to_string(bad) + " of its " + std::to_string(table_.blocks / returns) +
            " firings have an impossible azimuth");
}

void HesaiDecoder::decode_firing(const Firing& firing) {
  for (std::size_t channel = 0; channel < beams_.size(); ++channel) {
    const Beam& beam = beams_[channel];
    const std::size_t at = channel * table_.return_bytes;
    const std::uint8_t* first = firing.first + at;
    const std::uint8_t* second = firing.second == nullptr ? nullptr : firing.second + at;
    std::uint16_t distance = 0;
    std::uint16_t other = 0;
    std::memcpy(&distance, first, 2);
    if (second != nullptr) std::memcpy(&other, second, 2);
    if (other == 0 || other == distance) {
      add_return(first, beam, firing, 0);
    } else if (distance == 0) {
      add_return(second, beam, firing, 0);
    } else {
      const bool first_brighter = first[2] >= second[2];
      add_return(first, beam, firing, first_brighter ? 0 : 1);
      add_return(second, beam, firing, first_brighter ? 1 : 0);
    }
  }
}

void HesaiDecoder::add_return(const std::uint8_t* raw, const Beam& beam, const Firing& firing,
                              std::uint8_t return_index) {
  std::uint16_t distance = 0;
  std::memcpy(&distance, raw, 2);
  const double range = distance * unit_m_;
  if (range <= 0.0 || range < config_.min_range_m) return;
  const double plane = range * beam.cos_elevation;
  ScanPoint point;
  point.x = static_cast<float>(plane *
                               (firing.sine * beam.cos_azimuth + firing.cosine * beam.sin_azimuth));
  point.y = static_cast<float>(plane *
                               (firing.cosine * beam.cos_azimuth - firing.sine * beam.sin_azimuth));
  point.z = static_cast<float>(range * beam.sin_elevation);
  point.intensity = raw[2];
  point.ring = beam.ring;
  point.return_index = return_index;
  growing_.add(point, firing.time + beam.firing_ns);
}

// Ends the scan when the head passes the start angle, whichever way it turns. Small steps across it
// do not count as a turn.
void HesaiDecoder::turn_to(double azimuth_deg, TimeNs time) {
  double turned = azimuth_deg - config_.scan_start_deg;
  turned -= kTurnDeg * std::floor(turned / kTurnDeg);
  const bool jumped = turned_deg_ >= 0.0 && std::abs(turned - turned_deg_) > 0.5 * kTurnDeg;
  const bool short_scan = time - scan_begin_ < kNsPerSecond / 100;
  const bool endless =
      !growing_.empty() && (time - scan_begin_ > kLongestTurn || time < scan_begin_ - kLongestTurn);
  if (endless) missing_deg_ = 0.0;  // it does not spin
  if ((jumped && !short_scan) || endless) close_scan();
  if (missing_deg_ < 0.0) missing_deg_ = turned;
  if (growing_.empty()) scan_begin_ = time;
  turned_deg_ = turned;
}

void HesaiDecoder::close_scan() {
  finished_.add(growing_.take(static_cast<int>(table_.channels)), missing_deg_ / kTurnDeg);
  missing_deg_ = -1.0;
}

void HesaiDecoder::finish() {
  close_scan();
  finished_.finish();
}

void HesaiDecoder::save(BinaryWriter& writer) const {
  writer.put(model_);
  writer.put(contradicting_);
  writer.put(degrees_per_us_);
  clock_.save(writer);
  writer.put(return_mode_);
  writer.put(received_);
  writer.put(sequence_.has_value());
  writer.put(sequence_.value_or(0));
  writer.put(turned_deg_);
  writer.put(missing_deg_);
  writer.put(scan_begin_);
  growing_.save(writer);
  finished_.save(writer);
}

void HesaiDecoder::load(BinaryReader& reader) {
  const HesaiModel model = reader.get_enum(HesaiModel::kQt64);
  if (model != HesaiModel::kUnknown) set_model(model);
  contradicting_ = reader.get_enum(HesaiModel::kQt64);
  set_turn(reader.get<double>());
  clock_.load(reader);
  return_mode_ = reader.get<std::uint8_t>();
  received_ = reader.get<std::uint64_t>();
  const bool numbered = reader.get<bool>();
  const auto number = reader.get<std::uint32_t>();
  sequence_ = numbered ? std::optional(number) : std::nullopt;
  turned_deg_ = reader.get<double>();
  missing_deg_ = reader.get<double>();
  scan_begin_ = reader.get<TimeNs>();
  growing_.load(reader, source_);
  finished_.load(reader);
}

std::string HesaiDecoder::conventions() const {
  std::string text = returns_of(return_mode_) == 2 ? "dual return"
                     : return_mode_ == 0x38        ? "last return"
                     : return_mode_ == 0x37        ? "strongest return"
                                                   : "single return";
  text += "; firing times per channel";
  text += config_.calibration.firing_us.empty() ? "" : " of a file";
  text += config_.calibration.elevation_deg.empty() ? "; angles of the design"
                                                    : "; angles of the sensor's file";
  return text + (clock_.synchronised() ? "; time = sensor clock"
                                       : "; time = stamps smoothed by the sensor clock");
}

}  // namespace understory
