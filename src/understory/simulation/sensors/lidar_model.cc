#include "understory/simulation/sensors/lidar_model.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

// Ouster's lasers fire together, in four staggered columns.
struct OusterHead {
  int beams;
  double half_view_deg;
  double stagger_deg[4];
  double beam_origin_m;
};

LidarModel ouster(const LidarConfig& config, const OusterHead& head) {
  LidarModel model;
  for (int i = 0; i < head.beams; ++i) {
    model.beams.push_back(
        {kDegree * (-head.half_view_deg + 2.0 * head.half_view_deg * i / (head.beams - 1)),
         kDegree * head.stagger_deg[i % 4], 0.0, static_cast<std::uint16_t>(i)});
  }
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = model.revolution_ns / config.columns;
  model.beam_origin_m = head.beam_origin_m;
  model.beams_at_once = true;
  return model;
}

// 16 lasers two degrees apart, the lower eight upwards, then the upper eight downwards: 3 us from
// laser to laser, 50 us a sequence.
LidarModel rs_16(const LidarConfig& config) {
  LidarModel model;
  for (int i = 0; i < 16; ++i) {
    const int elevation = i < 8 ? -15 + 2 * i : 15 - 2 * (i - 8);
    model.beams.push_back(
        {kDegree * elevation, 0.0, 3000.0 * i, static_cast<std::uint16_t>((elevation + 15) / 2)});
  }
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = 50000.0;
  return model;
}

// Two blocks of 32 lasers, each in four columns. The upper one is a third of a degree apart from 2
// degrees down, the lower one half a degree. A pair, one of each block, fires every 1.5 us; 48 us a
// sequence.
LidarModel hdl_64(const LidarConfig& config) {
  constexpr double kColumns[4] = {-3.9, 2.6, -1.3, 5.2};
  LidarModel model;
  for (int i = 0; i < 32; ++i) {
    const double delay = 1500.0 * i;
    model.beams.push_back({kDegree * (-24.33 + 0.5 * i), kDegree * kColumns[i % 4], delay,
                           static_cast<std::uint16_t>(i)});
    model.beams.push_back({kDegree * (-8.33 + i / 3.0), kDegree * kColumns[i % 4], delay,
                           static_cast<std::uint16_t>(32 + i)});
  }
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = 48000.0;
  return model;
}

// 16 lasers in the firing order of the manual: 2.304 us apart, 55.296 us a sequence.
LidarModel vlp_16(const LidarConfig& config) {
  constexpr int kElevations[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
  LidarModel model;
  for (int i = 0; i < 16; ++i) {
    model.beams.push_back({kDegree * kElevations[i], 0.0, 2304.0 * i,
                           static_cast<std::uint16_t>((kElevations[i] + 15) / 2)});
  }
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = 55296.0;
  return model;
}

// 32 lasers a degree apart, from the highest down. The first fires 6 us after the block's time,
// then one every 1.512 us, 50 us a sequence. Source: PandarXT User Manual, "Channel Distribution"
// and "Absolute Time of Point Cloud Data".
LidarModel xt_32(const LidarConfig& config) {
  LidarModel model;
  for (int i = 0; i < 32; ++i)
    model.beams.push_back(
        {kDegree * (15 - i), 0.0, 1512.0 * i, static_cast<std::uint16_t>(31 - i)});
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = 50000.0;
  return model;
}

// Four lines from -7 to 52 degrees and 200 000 points a second (Mid-360 User Manual v1.2,
// "Specifications"). Livox publishes no equation of the pattern. This one stands in for it. It has
// one turn a frame, and a golden share of a swing left over from turn to turn. Swings of later
// turns then fall between those of earlier ones.
LidarModel mid_360(const LidarConfig& config) {
  constexpr int kLines = 4;
  constexpr double kSwingsPerTurn = 17.0 + 0.6180339887498949;
  LidarModel model;
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = 20000.0;
  model.swing_hz = config.rate_hz * kSwingsPerTurn;
  model.swing_low_rad = -7.0 * kDegree;
  model.swing_high_rad = 52.0 * kDegree;
  // Up and down strokes are half a swing's turn apart, and the lines share that angle.
  const double apart = kTau / (2.0 * kSwingsPerTurn * kLines);
  for (int i = 0; i < kLines; ++i)
    model.beams.push_back({0.0, apart * (i - 1.5), 0.0, static_cast<std::uint16_t>(i)});
  model.beams_at_once = true;
  return model;
}

// 32 lasers of uneven elevations, dense around the horizon, in the firing order of the data sheet:
// a pair every 2.304 us, 55.296 us a sequence. Azimuth offsets are only similar.
LidarModel vlp_32c(const LidarConfig& config) {
  constexpr double kElevations[32] = {
      -25.0,  -1.0,   -1.667, -15.639, -11.31, 0.0,    -0.667, -8.843, -7.254, 0.333,  -0.333,
      -6.148, -5.333, 1.333,  0.667,   -4.0,   -4.667, 1.667,  1.0,    -3.667, -3.333, 3.333,
      2.333,  -2.667, -3.0,   7.0,     4.667,  -2.333, -2.0,   15.0,   10.333, -1.333};
  constexpr double kColumns[4] = {1.4, -4.2, 4.2, -1.4};
  LidarModel model;
  for (int i = 0; i < 32; ++i) {
    const auto below = std::count_if(std::begin(kElevations), std::end(kElevations),
                                     [&](double other) { return other < kElevations[i]; });
    model.beams.push_back({kDegree * kElevations[i], kDegree * kColumns[i % 4],
                           2304.0 * static_cast<double>(i / 2), static_cast<std::uint16_t>(below)});
  }
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = 55296.0;
  return model;
}

}  // namespace

double LidarModel::elevation(std::size_t beam, double time_ns) const {
  if (!swings()) return beams[beam].elevation_rad;
  const double swung = time_ns * 1e-9 * swing_hz;
  const double share = std::abs(2.0 * (swung - std::floor(swung)) - 1.0);
  return swing_low_rad + share * (swing_high_rad - swing_low_rad);
}

double LidarModel::azimuth(double time_ns) const {
  const double turns = time_ns / revolution_ns;
  return std::numbers::pi - kTau * (turns - std::floor(turns));
}

TimeNs LidarModel::firing_time(std::int64_t firing) const {
  return static_cast<TimeNs>(std::llround(static_cast<double>(firing) * firing_ns));
}

LidarModel::Firings LidarModel::firings(std::int64_t scan) const {
  const double start = static_cast<double>(scan) * revolution_ns;
  const double blind = 0.5 * (1.0 - half_fov_rad / std::numbers::pi) * revolution_ns;
  // A thousandth of a firing of slack keeps rounding from moving a firing to the next scan.
  const auto first = std::ceil((start + blind) / firing_ns - 1e-3);
  const auto end = std::ceil((start + revolution_ns - blind) / firing_ns - 1e-3);
  return {static_cast<std::int64_t>(first), static_cast<std::int64_t>(end)};
}

LidarModel make_lidar_model(const LidarConfig& config) {
  LidarModel model;
  if (config.model == "VLP-16") model = vlp_16(config);
  if (config.model == "VLP-32C") model = vlp_32c(config);
  if (config.model == "XT32") model = xt_32(config);
  if (config.model == "RS-16") model = rs_16(config);
  if (config.model == "HDL-64") model = hdl_64(config);
  if (config.model == "Mid-360") model = mid_360(config);
  if (config.model == "OS0-128") {
    model = ouster(config, {128, 45.0, {11.1, 3.7, -3.7, -11.1}, 0.02767});
  }
  if (config.model == "OS1-64") {
    model = ouster(config, {64, 16.6, {3.164, 1.055, -1.055, -3.164}, 0.012163});
  }
  if (config.model == "OS1-128") {
    model = ouster(config, {128, 22.5, {4.2, 1.4, -1.4, -4.2}, 0.015806});
  }
  UNDERSTORY_CHECK(!model.beams.empty());
  model.half_fov_rad = 0.5 * config.fov_deg * kDegree;
  return model;
}

}  // namespace understory
