#include "understory/recording/captures/velodyne.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string_view>
#include <utility>

#include "understory/recording/captures/nmea.h"
#include "understory/recording/captures/scan_assembly.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

constexpr double kTurnCdeg = 36'000.0;
constexpr std::size_t kBlockSize = 100;
constexpr std::size_t kReturnSize = 3;
constexpr std::size_t kTrailer = 1200;  // time stamp, return mode, product
constexpr std::uint8_t kDualMode = 0x39;
constexpr std::uint8_t kDualConfidenceMode = 0x3A;
// The fastest head turns 20 times a second.
constexpr double kFastestCdegPerUs = 25.0 * kTurnCdeg * 1e-6;
constexpr double kRateSlack = 0.05;  // centidegrees/us: noise of the azimuth's last digits
constexpr TimeNs kLongestScan = kNsPerSecond / 2;
constexpr std::size_t kPositionCounter = 198;
constexpr std::size_t kPositionSentence = 206;
constexpr std::size_t kPositionSentenceSize = 128;

template <typename T>
T read(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

// In [-half a turn, half a turn).
double wrap_cdeg(double azimuth) {
  return azimuth - kTurnCdeg * std::floor(azimuth / kTurnCdeg + 0.5);
}

double positive_cdeg(double azimuth) {
  const double wrapped = azimuth - kTurnCdeg * std::floor(azimuth / kTurnCdeg);
  return wrapped < kTurnCdeg ? wrapped : 0.0;
}

// The sentence of a position packet if it has place, day and time.
std::optional<NmeaSentence> position_sentence(const std::uint8_t* data, std::size_t size) {
  if (size != VelodyneDecoder::kPositionPacketSize) return std::nullopt;
  const std::string_view text(reinterpret_cast<const char*>(data) + kPositionSentence,
                              kPositionSentenceSize);
  auto sentence = parse_nmea(text.substr(0, text.find('\n')));
  if (!sentence || !sentence->latitude_deg || !sentence->time_of_day || !sentence->day)
    return std::nullopt;
  return sentence;
}

TimeNs utc_of(const NmeaSentence& sentence) {
  return *sentence.day * 86'400 * kNsPerSecond + *sentence.time_of_day;
}

}  // namespace

VelodyneDecoder::VelodyneDecoder(const VelodyneConfig& config, std::string source, Log& log)
    : config_(config), source_(source), log_(log), finished_(std::move(source), log) {
  if (config_.model != VelodyneModel::kUnknown) {
    model_ = config_.model;
    table_ = velodyne_table(model_);
  }
}

void VelodyneDecoder::damaged(const std::string& what) {
  report_finding(log_, Finding::kDamagedPacket,
                 source_ + ": Velodyne packet " + std::to_string(received_) + ": " + what);
}

void VelodyneDecoder::add_packet(const std::uint8_t* data, std::size_t size, TimeNs stamp) {
  ++received_;
  if (size != kDataPacketSize) {
    damaged("has " + std::to_string(size) + " bytes, expected 1206");
    return;
  }
  if (!accept_model(data[kTrailer + 5])) return;
  const auto counter_us = read<std::uint32_t>(data + kTrailer);
  if (comes_twice(data, counter_us)) {
    damaged("comes twice");
    return;
  }
  const Blocks blocks = read_blocks(data);
  const auto time = clock_.time(counter_us, stamp);
  if (!time) {
    damaged("its time stamp of " + std::to_string(counter_us) +
            " us since the hour does not follow the one before");
    return;
  }
  ++packets_;
  return_mode_ = data[kTrailer + 4];
  const std::size_t step = dual_ ? 2 : 1;
  for (std::size_t block = 0; block < kBlocks; block += step) {
    for (int sequence = 0; sequence < table_.sequences_per_block; ++sequence)
      decode_sequence(blocks, block, sequence, *time);
  }
}

// A head that turns sends no two packets of one time and the same azimuths.
bool VelodyneDecoder::comes_twice(const std::uint8_t* data, std::uint32_t counter_us) {
  const std::array<std::uint32_t, 3> marks = {
      counter_us, read<std::uint16_t>(data + 2),
      read<std::uint16_t>(data + (kBlocks - 1) * kBlockSize + 2)};
  return marks == std::exchange(last_marks_, marks);
}

// The model is that of the first packet; a packet that contradicts it is taken as damaged unless
// the next one says the same.
bool VelodyneDecoder::accept_model(std::uint8_t product_byte) {
  if (config_.model != VelodyneModel::kUnknown) return true;
  const VelodyneModel model = velodyne_model(product_byte);
  if (model == model_ && model != VelodyneModel::kUnknown) {
    contradicting_ = VelodyneModel::kUnknown;
    return true;
  }
  if (model == VelodyneModel::kUnknown) {
    damaged("product " + std::to_string(product_byte) +
            " is none of VLP-16, Puck Hi-Res, HDL-32E, VLP-32C");
    return false;
  }
  if (model_ != VelodyneModel::kUnknown && contradicting_ != model) {
    contradicting_ = model;
    damaged("another sensor model than before");
    return false;
  }
  close_scan();
  model_ = model;
  table_ = velodyne_table(model);
  return true;
}

VelodyneDecoder::Blocks VelodyneDecoder::read_blocks(const std::uint8_t* data) {
  const std::uint8_t mode = data[kTrailer + 4];
  dual_ = mode == kDualMode || mode == kDualConfidenceMode;
  Blocks blocks;
  std::size_t bad = 0;
  for (std::size_t b = 0; b < kBlocks; ++b) {
    const std::uint8_t* raw = data + b * kBlockSize;
    const auto azimuth = read<std::uint16_t>(raw + 2);
    if (raw[0] != 0xFF || raw[1] != 0xEE || azimuth >= 36'000) {
      ++bad;
      continue;
    }
    blocks[b].returns = raw + 4;
    blocks[b].azimuth_cdeg = azimuth;
  }
  if (bad > 0) damaged(std::to_string(bad) + " of 12 blocks have a wrong flag or azimuth");
  set_rates(blocks);
  return blocks;
}

// The rate of turn behind each block is the difference to the next block. Blocks whose azimuth goes
// neither with the block before nor with the one behind, by the packet's median rate, are damaged.
void VelodyneDecoder::set_rates(Blocks& blocks) {
  const std::size_t step = dual_ ? 2 : 1;
  std::vector<double> rates;
  for (std::size_t b = 0; b + step < kBlocks; b += step) {
    Block& block = blocks[b];
    const Block& next = blocks[b + step];
    block.cdeg_per_us = -1.0;
    if (block.returns == nullptr || next.returns == nullptr) continue;
    const double us = sequence_start_us(b + step, 0) - sequence_start_us(b, 0);
    block.cdeg_per_us = wrap_cdeg(next.azimuth_cdeg - block.azimuth_cdeg) / us;
    rates.push_back(block.cdeg_per_us);
  }
  const bool too_few_to_judge = rates.size() < 3;
  const double rate = upper_median(std::move(rates), -1.0);
  if (rate >= 0.0 && rate < kFastestCdegPerUs) rate_cdeg_per_us_ = rate;
  std::array<bool, kBlocks> plausible{};
  for (std::size_t b = 0; b < kBlocks; b += step) {
    plausible[b] =
        std::abs(blocks[b].cdeg_per_us - rate_cdeg_per_us_) < 0.5 * rate_cdeg_per_us_ + kRateSlack;
  }
  double before = rate_cdeg_per_us_;
  for (std::size_t b = 0; b < kBlocks; b += step) {
    Block& block = blocks[b];
    const bool fits = plausible[b] || (b >= step && plausible[b - step]) || too_few_to_judge;
    if (block.returns != nullptr && !fits) {
      damaged("the azimuth of block " + std::to_string(b) + " does not go with its neighbours");
      block.returns = nullptr;
    }
    if (!plausible[b]) block.cdeg_per_us = before;
    before = block.cdeg_per_us;
  }
}

double VelodyneDecoder::sequence_start_us(std::size_t block, int sequence) const {
  const std::size_t turn = dual_ ? block / 2 : block;
  return table_.sequence_us *
         static_cast<double>(turn * static_cast<std::size_t>(table_.sequences_per_block) +
                             static_cast<std::size_t>(sequence));
}

void VelodyneDecoder::decode_sequence(const Blocks& blocks, std::size_t block, int sequence,
                                      TimeNs packet_time) {
  const Block& first = blocks[block];
  if (first.returns == nullptr) return;
  const std::uint8_t* second = nullptr;
  if (dual_ && blocks[block + 1].returns != nullptr &&
      blocks[block + 1].azimuth_cdeg == first.azimuth_cdeg)
    second = blocks[block + 1].returns;
  const double start_us = sequence_start_us(block, sequence);
  const double since_block_us = start_us - sequence_start_us(block, 0);
  turn_to(first.azimuth_cdeg + first.cdeg_per_us * since_block_us,
          packet_time + static_cast<TimeNs>(std::llround(start_us * 1000.0)));
  const std::size_t skipped = static_cast<std::size_t>(sequence) * table_.lasers.size();
  for (std::size_t laser = 0; laser < table_.lasers.size(); ++laser) {
    const double laser_us = table_.lasers[laser].firing_us;
    const Shot shot{
        first.azimuth_cdeg + first.cdeg_per_us * (since_block_us + laser_us),
        packet_time + static_cast<TimeNs>(std::llround((start_us + laser_us) * 1000.0))};
    const std::size_t at = (skipped + laser) * kReturnSize;
    add_returns(first.returns + at, second == nullptr ? nullptr : second + at, laser, shot);
  }
}

void VelodyneDecoder::add_returns(const std::uint8_t* first, const std::uint8_t* second,
                                  std::size_t laser, const Shot& shot) {
  const auto distance = read<std::uint16_t>(first);
  const auto other = second == nullptr ? std::uint16_t{0} : read<std::uint16_t>(second);
  if (other == 0 || other == distance) {
    add_return(first, laser, shot, 0);
    return;
  }
  if (distance == 0) {
    add_return(second, laser, shot, 0);
    return;
  }
  const bool first_brighter = first[2] >= second[2];
  add_return(first, laser, shot, first_brighter ? 0 : 1);
  add_return(second, laser, shot, first_brighter ? 1 : 0);
}

void VelodyneDecoder::add_return(const std::uint8_t* raw, std::size_t laser, const Shot& shot,
                                 std::uint8_t return_index) {
  const double range = read<std::uint16_t>(raw) * table_.distance_unit_m;
  if (range <= 0.0 || range < config_.min_range_m) return;
  const VelodyneTable::Laser& beam = table_.lasers[laser];
  const double azimuth =
      (shot.azimuth_cdeg + beam.azimuth_offset_cdeg) * (std::numbers::pi / 18'000.0);
  const double plane = range * beam.cos_elevation;
  ScanPoint point;
  point.x = static_cast<float>(plane * std::cos(azimuth));
  point.y = static_cast<float>(-plane * std::sin(azimuth));
  point.z = static_cast<float>(range * beam.sin_elevation +
                               (config_.vertical_offsets ? beam.height_m : 0.0));
  point.intensity = raw[2];
  point.ring = beam.ring;
  point.return_index = return_index;
  growing_.add(point, shot.time);
}

// Ends the scan when the head passes the start angle. Small steps back (the head's encoder is noisy
// by its resolution) do not count as a turn.
void VelodyneDecoder::turn_to(double azimuth_cdeg, TimeNs time) {
  const double turned = positive_cdeg(azimuth_cdeg - config_.scan_start_deg * 100.0);
  const bool passed = turned < turned_cdeg_ - 0.5 * kTurnCdeg;
  const bool back = turned_cdeg_ >= 0.0 && turned > turned_cdeg_ + 0.5 * kTurnCdeg;
  const bool endless =
      !growing_.empty() && (time - scan_begin_ > kLongestScan || time < scan_begin_);
  if (endless) missing_cdeg_ = 0.0;  // it does not spin
  if (passed || endless) close_scan();
  if (missing_cdeg_ < 0.0) missing_cdeg_ = turned;
  if (growing_.empty()) scan_begin_ = time;
  if (!back || endless) turned_cdeg_ = turned;
}

void VelodyneDecoder::close_scan() {
  finished_.add(growing_.take(static_cast<int>(table_.lasers.size())), missing_cdeg_ / kTurnCdeg);
  missing_cdeg_ = -1.0;
}

bool VelodyneDecoder::set_clock(const std::uint8_t* data, std::size_t size) {
  const auto sentence = position_sentence(data, size);
  return sentence &&
         clock_.set_utc(read<std::uint32_t>(data + kPositionCounter), utc_of(*sentence));
}

std::optional<GnssFix> VelodyneDecoder::add_position_packet(const std::uint8_t* data,
                                                            std::size_t size) {
  const auto sentence = position_sentence(data, size);
  if (!sentence) return std::nullopt;
  const TimeNs utc = utc_of(*sentence);
  clock_.set_utc(read<std::uint32_t>(data + kPositionCounter), utc);
  if (utc == last_fix_) return std::nullopt;
  last_fix_ = utc;
  return nmea_fix(*sentence, utc);
}

ScanPtr VelodyneDecoder::take_scan() {
  return finished_.take();
}

void VelodyneDecoder::finish() {
  close_scan();
  finished_.finish();
}

void VelodyneDecoder::save(BinaryWriter& writer) const {
  writer.put(model_);
  writer.put(contradicting_);
  clock_.save(writer);
  writer.put(dual_);
  writer.put(return_mode_);
  writer.put(packets_);
  writer.put(received_);
  writer.put(last_fix_);
  writer.put(last_marks_);
  for (const double value : {rate_cdeg_per_us_, turned_cdeg_, missing_cdeg_})
    writer.put(value);
  writer.put(scan_begin_);
  growing_.save(writer);
  finished_.save(writer);
}

void VelodyneDecoder::load(BinaryReader& reader) {
  model_ = reader.get_enum(VelodyneModel::kVlp32c);
  if (model_ != VelodyneModel::kUnknown) table_ = velodyne_table(model_);
  contradicting_ = reader.get_enum(VelodyneModel::kVlp32c);
  clock_.load(reader);
  dual_ = reader.get<bool>();
  return_mode_ = reader.get<std::uint8_t>();
  packets_ = reader.get<std::uint64_t>();
  received_ = reader.get<std::uint64_t>();
  last_fix_ = reader.get<TimeNs>();
  last_marks_ = reader.get<std::array<std::uint32_t, 3>>();
  for (double* value : {&rate_cdeg_per_us_, &turned_cdeg_, &missing_cdeg_})
    *value = reader.get<double>();
  scan_begin_ = reader.get<TimeNs>();
  growing_.load(reader, source_);
  finished_.load(reader);
}

std::string VelodyneDecoder::conventions() const {
  std::string text = dual_                  ? "dual return"
                     : return_mode_ == 0x38 ? "last return"
                     : return_mode_ == 0x37 ? "strongest return"
                                            : "single return";
  text += "; firing times per laser; time = ";
  switch (clock_.source()) {
    case VelodyneClock::Source::kPosition:
      text += "sensor clock with the hour of position packets";
      break;
    case VelodyneClock::Source::kStamp:
      text += "sensor clock with the hour of the stamps";
      break;
    default:
      text += "stamps smoothed by the sensor clock (no UTC at the sensor)";
  }
  text += config_.vertical_offsets ? "; with the beams' vertical offsets"
                                   : "; without vertical offsets";
  return text;
}

}  // namespace understory
