#include "understory/recording/captures/hesai/hesai_tables.h"

#include <utility>

namespace understory {
namespace {

constexpr std::size_t kShortest = 12;

// Appendix I of the Pandar64 manual; downwards.
constexpr double kPandar64Elevations[] = {
    14.882, 11.032, 8.059,   5.057,   3.04,    2.028,   1.86,   1.688,   1.522,  1.351,  1.184,
    1.013,  0.846,  0.675,   0.508,   0.337,   0.169,   0.0,    -0.169,  -0.337, -0.508, -0.675,
    -0.845, -1.013, -1.184,  -1.351,  -1.522,  -1.688,  -1.86,  -2.028,  -2.198, -2.365, -2.536,
    -2.7,   -2.873, -3.04,   -3.21,   -3.375,  -3.548,  -3.712, -3.884,  -4.05,  -4.221, -4.385,
    -4.558, -4.72,  -4.892,  -5.057,  -5.229,  -5.391,  -5.565, -5.726,  -5.898, -6.061, -7.063,
    -8.059, -9.06,  -10.045, -11.032, -12.006, -12.974, -13.93, -18.889, -24.897};

// By laser, us: the two numbers of each line of the firing sequence share a time.
constexpr double kPandar64Firings[] = {
    -23.18,  -21.876, -20.572, -19.268, -17.964, -16.66,  -11.444, -46.796, -7.532,  -36.956,
    -50.732, -54.668, -40.892, -44.828, -31.052, -34.988, -48.764, -52.7,   -38.924, -42.86,
    -29.084, -33.02,  -46.796, -25.148, -36.956, -50.732, -27.116, -40.892, -44.828, -31.052,
    -34.988, -48.764, -25.148, -38.924, -42.86,  -29.084, -33.02,  -52.7,   -6.228,  -54.668,
    -15.356, -27.116, -10.14,  -23.18,  -4.924,  -21.876, -14.052, -17.964, -8.836,  -19.268,
    -3.62,   -20.572, -12.748, -16.66,  -7.532,  -11.444, -6.228,  -15.356, -10.14,  -4.924,
    -3.62,   -14.052, -8.836,  -12.748};

// Upwards.
constexpr double kQt64Elevations[] = {
    -52.121, -49.785, -47.577, -45.477, -43.465, -41.528, -39.653, -37.831, -36.055, -34.320,
    -32.619, -30.950, -29.308, -27.690, -26.094, -24.517, -22.964, -21.420, -19.889, -18.372,
    -16.865, -15.368, -13.880, -12.399, -10.925, -9.457,  -7.994,  -6.535,  -5.079,  -3.626,
    -2.175,  -0.725,  0.725,   2.175,   3.626,   5.079,   6.534,   7.993,   9.456,   10.923,
    12.397,  13.877,  15.365,  16.861,  18.368,  19.885,  21.415,  22.959,  24.524,  26.101,
    27.697,  29.315,  30.957,  32.627,  34.328,  36.064,  37.840,  39.662,  41.537,  43.475,
    45.487,  47.587,  49.795,  52.133};

constexpr double kQt64Azimuths[] = {
    8.736,  8.314,  7.964,  7.669,  7.417,  7.198,  7.007,  6.838,  6.688,  6.554,  6.434,
    6.326,  6.228,  6.140,  6.059,  5.987,  -5.270, -5.216, -5.167, -5.123, -5.083, -5.047,
    -5.016, -4.988, -4.963, -4.942, -4.924, -4.910, -4.898, -4.889, -4.884, -4.881, 5.493,
    5.496,  5.502,  5.512,  5.525,  5.541,  5.561,  5.584,  5.611,  5.642,  5.676,  5.716,
    5.759,  5.808,  5.862,  5.921,  -5.330, -5.396, -5.469, -5.550, -5.640, -5.740, -5.850,
    -5.974, -6.113, -6.269, -6.447, -6.651, -6.887, -7.163, -7.493, -7.892};

// us, after the start of the block.
constexpr double kQt64Firings[] = {
    2.31,  4.37,   6.43,   8.49,   10.54,  12.6,   14.66,  16.71,  19.16,  21.22,  23.28,
    25.34, 27.39,  29.45,  31.5,   33.56,  36.61,  38.67,  40.73,  42.78,  44.84,  46.9,
    48.95, 51.01,  53.45,  55.52,  57.58,  59.63,  61.69,  63.74,  65.8,   67.86,  70.9,
    72.97, 75.02,  77.08,  79.14,  81.19,  83.25,  85.3,   87.75,  89.82,  91.87,  93.93,
    95.98, 98.04,  100.1,  102.15, 105.2,  107.26, 109.32, 111.38, 113.43, 115.49, 117.54,
    119.6, 122.05, 124.11, 126.17, 128.22, 130.28, 132.34, 134.39, 136.45};

template <std::size_t kCount>
std::vector<double> of(const double (&numbers)[kCount]) {
  return {numbers, numbers + kCount};
}

// Both PandarXT: 8 blocks, 50 us from firing to firing, from the highest beam down.
HesaiTable xt(std::size_t channels, double step_deg, double channel_us, std::string name) {
  HesaiTable table;
  table.name = std::move(name);
  table.channels = channels;
  table.blocks = 8;
  table.header_bytes = 12;
  table.return_bytes = 4;
  table.mode_at = 10;
  table.motor_at = 11;
  table.date_at = 13;
  table.microseconds_at = 19;
  table.tail_bytes = 24;
  table.flags_at = 11;
  table.block_us = 50.0;
  for (std::size_t i = 0; i < channels; ++i) {
    table.firing_us.push_back(6.0 + channel_us * static_cast<double>(i));
    table.elevation_deg.push_back(15.0 - step_deg * static_cast<double>(i));
  }
  table.azimuth_deg.assign(channels, 0.0);
  return table;
}

HesaiTable pandar64() {
  HesaiTable table;
  table.name = "Pandar64";
  table.channels = 64;
  table.blocks = 6;
  table.header_bytes = 8;
  table.return_bytes = 3;
  table.motor_at = 8;
  table.microseconds_at = 10;
  table.mode_at = 14;
  table.date_at = 16;
  table.tail_bytes = 22;
  table.flags_at = 7;
  table.offset_us = -42.58;
  table.block_us = 55.56;
  table.firing_us = of(kPandar64Firings);
  table.elevation_deg = of(kPandar64Elevations);
  // The first six and the last eleven lasers stand in one column, the others take turns in six.
  constexpr double kColumns[6] = {1.042, 3.125, 5.208, -5.208, -3.125, -1.042};
  for (std::size_t i = 0; i < table.channels; ++i)
    table.azimuth_deg.push_back(i < 6 || i > 53 ? -1.042 : kColumns[(i - 6) % 6]);
  return table;
}

HesaiTable qt64() {
  HesaiTable table;
  table.name = "PandarQT64";
  table.channels = 64;
  table.blocks = 4;
  table.header_bytes = 12;
  table.return_bytes = 4;
  table.motor_at = 10;
  table.microseconds_at = 12;
  table.mode_at = 16;
  table.date_at = 18;
  table.tail_bytes = 24;
  table.flags_at = 11;
  table.time_of_last = false;
  table.offset_us = 35.71;
  table.block_us = 500.0 / 3.0;
  table.firing_us = of(kQt64Firings);
  table.elevation_deg = of(kQt64Elevations);
  table.azimuth_deg = of(kQt64Azimuths);
  return table;
}

std::string protocol(ByteSpan payload) {
  return " (protocol " + std::to_string(payload[2]) + "." + std::to_string(payload[3]) + ", " +
         std::to_string(payload[6]) + " channels, " + std::to_string(payload[7]) + " blocks)";
}

}  // namespace

HesaiTable hesai_table(HesaiModel model) {
  switch (model) {
    case HesaiModel::kXt32:
      return xt(32, 1.0, 1.512, "PandarXT-32");
    case HesaiModel::kXt16:
      return xt(16, 2.0, 3.024, "PandarXT-16");
    case HesaiModel::kPandar64:
      return pandar64();
    case HesaiModel::kQt64:
      return qt64();
    case HesaiModel::kUnknown:
      break;
  }
  return {};
}

bool is_hesai_data(ByteSpan payload) {
  constexpr std::size_t kPandar40[] = {1256, 1262, 1266};
  if (payload.size() < kShortest) return false;
  if (payload[0] == 0xEE && payload[1] == 0xFF) return true;
  if (payload[0] != 0xFF || payload[1] != 0xEE) return false;
  for (const std::size_t size : kPandar40) {
    if (payload.size() == size) return true;
  }
  return false;
}

HesaiKind hesai_kind(ByteSpan payload) {
  if (!is_hesai_data(payload)) return {HesaiModel::kUnknown, "no Hesai"};
  if (payload[0] == 0xFF) return {HesaiModel::kUnknown, "a Pandar40"};
  // Pandar64 has no number of a protocol: its channels and blocks stand there.
  if (payload[2] == 64 && payload[3] == 6) return {HesaiModel::kPandar64, ""};
  const int version = payload[2] * 256 + payload[3];
  if (version == 0x0601 && payload[7] == 8) {
    if (payload[6] == 32) return {HesaiModel::kXt32, ""};
    if (payload[6] == 16) return {HesaiModel::kXt16, ""};
  }
  if (version == 0x0301 && payload[6] == 64 && payload[7] == 4) return {HesaiModel::kQt64, ""};
  switch (payload[2]) {
    case 1:
      return {HesaiModel::kUnknown, "a Pandar128, OT128 or JT" + protocol(payload)};
    case 3:
      return {HesaiModel::kUnknown, "a QT128" + protocol(payload)};
    case 4:
      return {HesaiModel::kUnknown, "an AT128 or ET25" + protocol(payload)};
    case 6:
      return {HesaiModel::kUnknown, "an XT32M" + protocol(payload)};
    default:
      return {HesaiModel::kUnknown, "another Hesai" + protocol(payload)};
  }
}

}  // namespace understory
