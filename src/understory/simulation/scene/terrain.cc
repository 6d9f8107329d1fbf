#include "understory/simulation/scene/terrain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "understory/simulation/sensors/counter_noise.h"

namespace understory {
namespace {

// Smooth random field: value noise on a lattice, interpolated so that slopes are continuous.
// Standard deviation about 1.
class ValueNoise {
 public:
  ValueNoise(std::uint64_t seed, double wavelength_m) : seed_(seed), scale_(2.0 / wavelength_m) {}

  [[nodiscard]] double at(double x, double y) const {
    const double gx = x * scale_;
    const double gy = y * scale_;
    const double cx = std::floor(gx);
    const double cy = std::floor(gy);
    const double u = ease(gx - cx);
    const double v = ease(gy - cy);
    const auto i = static_cast<std::int64_t>(cx);
    const auto j = static_cast<std::int64_t>(cy);
    const double south = lattice(i, j) * (1.0 - u) + lattice(i + 1, j) * u;
    const double north = lattice(i, j + 1) * (1.0 - u) + lattice(i + 1, j + 1) * u;
    return 1.3 * (south * (1.0 - v) + north * v);
  }

 private:
  static double ease(double t) { return t * t * t * (t * (6.0 * t - 15.0) + 10.0); }
  [[nodiscard]] double lattice(std::int64_t i, std::int64_t j) const {
    CounterNoise noise(seed_, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j));
    return noise.normal();
  }

  std::uint64_t seed_;
  double scale_;
};

// Depth of the ditches: straight lines across the site at 25 degrees to its edges, evenly apart,
// with sides as steep as a bell's.
double ditch_depth(const TerrainConfig& config, double x, double y, double half_m) {
  if (config.ditches == 0) return 0.0;
  constexpr double kCosine = 0.90631;
  constexpr double kSine = 0.42262;
  const double across = -kSine * x + kCosine * y;
  double depth = 0.0;
  for (int i = 0; i < config.ditches; ++i) {
    const double place = half_m * (2.0 * (i + 0.5) / config.ditches - 1.0);
    const double share = (across - place) / (0.5 * config.ditch_width_m);
    depth += config.ditch_depth_m * std::exp(-share * share);
  }
  return depth;
}

// How far the carrier pressed the snow down at a place: two ruts half a metre to both sides.
double rut_depth(const TerrainConfig& config, double distance_m) {
  const double depth = config.snow_m * config.track_depth;
  if (distance_m > 1.6) return 0.0;
  const double share = (distance_m - 0.5) / 0.4;
  return depth * std::exp(-share * share);
}

}  // namespace

Terrain::Terrain(const TerrainConfig& config, double half_x_m, double half_y_m, std::uint64_t seed,
                 const Route* way)
    : columns_(static_cast<int>(std::ceil(2.0 * half_x_m / config.cell_m)) + 1),
      rows_(static_cast<int>(std::ceil(2.0 * half_y_m / config.cell_m)) + 1),
      cell_m_(config.cell_m),
      west_m_(-0.5 * config.cell_m * (columns_ - 1)),
      south_m_(-0.5 * config.cell_m * (rows_ - 1)) {
  const std::uint64_t key = hash_numbers(seed, stream_of(NoiseStream::kTerrain));
  const ValueNoise hills(hash_numbers(key, 1), config.wavelength_m);
  const ValueNoise knolls(hash_numbers(key, 2), 0.37 * config.wavelength_m);
  const ValueNoise hummocks(hash_numbers(key, 3), 3.1);
  const ValueNoise tufts(hash_numbers(key, 4), 1.1);
  const double slope = std::tan(config.slope_deg * std::numbers::pi / 180.0);
  const double azimuth = config.slope_azimuth_deg * std::numbers::pi / 180.0;
  // Snow lies even: what is lower than its depth shows less and less.
  const double bare = 1.0 / (1.0 + 8.0 * config.snow_m);
  const double half_m = std::max(half_x_m, half_y_m);
  heights_.reserve(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  const bool ruts = way != nullptr && config.snow_m * config.track_depth > 0.0;
  for (int row = 0; row < rows_; ++row) {
    double no_rut_to_x = -std::numeric_limits<double>::infinity();
    for (int column = 0; column < columns_; ++column) {
      const double x = west_m_ + cell_m_ * column;
      const double y = south_m_ + cell_m_ * row;
      CounterNoise noise(hash_numbers(key, 5), static_cast<std::uint64_t>(column),
                         static_cast<std::uint64_t>(row));
      const double hummock = config.hummock_m * bare;
      const double roughness = config.roughness_m * bare;
      double height = slope * (x * std::cos(azimuth) + y * std::sin(azimuth)) +
                      config.relief_m * (0.93 * hills.at(x, y) + 0.36 * knolls.at(x, y)) +
                      hummock * (0.9 * hummocks.at(x, y) + 0.43 * tufts.at(x, y)) +
                      roughness * noise.normal();
      height -= ditch_depth(config, x, y, half_m);
      if (ruts && x > no_rut_to_x) {
        const double away = way->distance_to({x, y}, 0.0, 1.0) - 1.6;
        if (away < 0.0) height -= rut_depth(config, way->distance_to({x, y}));
        no_rut_to_x = x + away - 1e-6;
      }
      heights_.push_back(height);
    }
  }
}

Eigen::Vector3d Terrain::vertex(int column, int row) const {
  return {west_m_ + cell_m_ * column, south_m_ + cell_m_ * row, at(column, row)};
}

double Terrain::height(double x, double y) const {
  const double gx = std::clamp((x - west_m_) / cell_m_, 0.0, columns_ - 1.0 - 1e-9);
  const double gy = std::clamp((y - south_m_) / cell_m_, 0.0, rows_ - 1.0 - 1e-9);
  const int i = static_cast<int>(gx);
  const int j = static_cast<int>(gy);
  const double u = gx - i;
  const double v = gy - j;
  const double sw = at(i, j);
  const double ne = at(i + 1, j + 1);
  if (u >= v) {
    const double se = at(i + 1, j);
    return sw + u * (se - sw) + v * (ne - se);
  }
  const double nw = at(i, j + 1);
  return sw + v * (nw - sw) + u * (ne - nw);
}

double Terrain::smooth_height(double x, double y, double radius_m) const {
  double sum = height(x, y);
  int count = 1;
  for (int ring = 1; ring <= 2; ++ring) {
    for (int k = 0; k < 8; ++k) {
      const double angle = (k + 0.5 * ring) * std::numbers::pi / 4.0;
      const double r = 0.5 * ring * radius_m;
      sum += height(x + r * std::cos(angle), y + r * std::sin(angle));
      ++count;
    }
  }
  return sum / count;
}

}  // namespace understory
