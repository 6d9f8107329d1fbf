#include "understory/simulation/lidar_model.h"

#include <cmath>
#include <numbers>

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kTau = 2.0 * std::numbers::pi;

// 128 beams over 90 degrees that fire together; four staggered columns of lasers.
LidarModel os0_128(const LidarConfig& config) {
  constexpr int kBeams = 128;
  constexpr double kStagger[4] = {11.1, 3.7, -3.7, -11.1};
  LidarModel model;
  for (int i = 0; i < kBeams; ++i) {
    model.beams.push_back({kDegree * (-45.0 + 90.0 * i / (kBeams - 1)), kDegree * kStagger[i % 4],
                           0.0, static_cast<std::uint16_t>(i)});
  }
  model.revolution_ns = 1e9 / config.rate_hz;
  model.firing_ns = model.revolution_ns / config.columns;
  model.beam_origin_m = 0.02767;
  model.beams_at_once = true;
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

}  // namespace

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
  LidarModel model = config.model == "VLP-16" ? vlp_16(config) : os0_128(config);
  model.half_fov_rad = 0.5 * config.fov_deg * kDegree;
  return model;
}

}  // namespace understory
