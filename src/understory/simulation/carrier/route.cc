#include "understory/simulation/carrier/route.h"

#include <algorithm>
#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

// A closed curve of unit mean radius whose radius waves with a few harmonics. With several laps the
// waves do not close after one, so that each lap takes another way and crosses the others.
std::vector<Eigen::Vector2d> unit_loop(Random& random, int laps) {
  double amplitude[4];
  double phase[4];
  for (int k = 0; k < 4; ++k) {
    amplitude[k] = random.uniform(0.4, 1.0) * 0.22 / (k + 1.5);
    phase[k] = random.uniform(0.0, kTau);
  }
  const double start = random.uniform(0.0, kTau);
  std::vector<Eigen::Vector2d> points;
  constexpr int kSteps = 20000;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = start + laps * (kTau * i / kSteps);
    double radius = 1.0;
    for (int k = 0; k < 4; ++k) {
      const double waves = laps == 1 ? k + 2 : (2.0 * k + 3.0) / laps;
      radius += amplitude[k] * std::cos(waves * angle + phase[k]);
    }
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return points;
}

// A road along x that winds a little.
std::vector<Eigen::Vector2d> strip_road(double length_m, Random& random) {
  const double bend = random.uniform(1.0, 2.5);
  const double phase = random.uniform(0.0, kTau);
  std::vector<Eigen::Vector2d> points;
  constexpr int kSteps = 20000;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = 1.2 * length_m * i / kSteps;
    points.emplace_back(x - 0.5 * length_m,
                        bend * std::sin(phase + kTau * x / std::max(length_m, 60.0)));
  }
  return points;
}

}  // namespace

Route::Route(const CarrierConfig& config, std::uint64_t seed) {
  make_points(config, seed);
  stretches_ = stretches_of(points_);
  road_stretches_ = stretches_of(roads_);
}

void Route::make_points(const CarrierConfig& config, std::uint64_t seed) {
  Random random(seed, stream_of(NoiseStream::kRoute));
  const bool strip =
      config.route == "strip" || (config.route == "auto" && config.kind == "harvester");
  if (strip && config.strip_roads > 1) {
    make_roads(config, random);
    return;
  }
  if (strip) {
    const double length = config.one_way ? config.length_m : 0.5 * config.length_m;
    resample(strip_road(length, random), length);
    return;
  }
  std::vector<Eigen::Vector2d> loop = unit_loop(random, config.laps);
  double length = 0.0;
  for (std::size_t i = 1; i < loop.size(); ++i)
    length += (loop[i] - loop[i - 1]).norm();
  for (Eigen::Vector2d& point : loop)
    point *= config.length_m / length;
  resample(loop, config.length_m);
  if (config.rounds > 1) repeat(config.rounds);
}

// The same curve again and again, from its end, which is where it begins.
void Route::repeat(int rounds) {
  roads_ = points_;
  const std::size_t once = points_.size();
  const double turned = kTau * std::round((headings_.back() - headings_.front()) / kTau);
  for (int round = 1; round < rounds; ++round) {
    for (std::size_t i = 1; i < once; ++i) {
      points_.push_back(points_[i]);
      headings_.push_back(headings_[i] + round * turned);
    }
  }
}

// Roads that wind together, so that they stay about as far apart as they should.
void Route::make_roads(const CarrierConfig& config, Random& random) {
  const double length = config.one_way ? config.length_m : 0.5 * config.length_m;
  const double phase = random.uniform(0.0, kTau);
  for (int road = 1; road <= config.strip_roads; ++road) {
    const double bend = random.uniform(1.5, 3.0);
    const double north = config.strip_spacing_m * (road - 0.5 * (config.strip_roads + 1));
    const double way = road % 2 == 1 ? 1.0 : -1.0;
    std::vector<Eigen::Vector2d> points;
    for (double along = -0.5 * length; along <= 0.7 * length; along += 0.05) {
      const double x = way * along;
      points.emplace_back(x, north + bend * std::sin(phase + kTau * x / std::max(length, 60.0)));
    }
    if (road == config.strip_road) resample(points, length);
    for (std::size_t i = 0; i < points.size(); i += 5)
      roads_.push_back(points[i]);
  }
}

void Route::resample(const std::vector<Eigen::Vector2d>& dense, double length_m) {
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::round(length_m / step_m_)));
  step_m_ = length_m / static_cast<double>(steps);
  std::size_t at = 1;
  double passed = 0.0;
  for (std::size_t i = 0; i <= steps; ++i) {
    const double wanted = step_m_ * static_cast<double>(i);
    double piece = (dense[at] - dense[at - 1]).norm();
    while (passed + piece < wanted && at + 1 < dense.size()) {
      passed += piece;
      ++at;
      piece = (dense[at] - dense[at - 1]).norm();
    }
    const double u = std::clamp((wanted - passed) / piece, 0.0, 1.0);
    points_.emplace_back(dense[at - 1] + u * (dense[at] - dense[at - 1]));
    const Eigen::Vector2d direction = dense[at] - dense[at - 1];
    double heading = std::atan2(direction.y(), direction.x());
    if (!headings_.empty()) {
      heading += kTau * std::round((headings_.back() - heading) / kTau);
    }
    headings_.push_back(heading);
  }
}

Eigen::Vector2d Route::place(double distance_m) const {
  const double at = std::clamp(distance_m, 0.0, length_m()) / step_m_;
  const auto i = std::min(static_cast<std::size_t>(at), points_.size() - 2);
  const double u = at - static_cast<double>(i);
  return points_[i] + u * (points_[i + 1] - points_[i]);
}

double Route::heading(double distance_m) const {
  const double at = std::clamp(distance_m, 0.0, length_m()) / step_m_;
  const auto i = std::min(static_cast<std::size_t>(at), points_.size() - 2);
  const double u = at - static_cast<double>(i);
  return headings_[i] + u * (headings_[i + 1] - headings_[i]);
}

std::vector<Route::Stretch> Route::stretches_of(const std::vector<Eigen::Vector2d>& points) {
  constexpr std::size_t kPoints = 32;
  std::vector<Stretch> stretches;
  for (std::size_t first = 0; first < points.size(); first += kPoints) {
    Stretch stretch{points[first], 0.0, first, std::min(first + kPoints, points.size())};
    stretch.middle = 0.5 * (points[first] + points[stretch.end - 1]);
    for (std::size_t i = first; i < stretch.end; ++i)
      stretch.radius_m = std::max(stretch.radius_m, (points[i] - stretch.middle).norm());
    stretches.push_back(stretch);
  }
  return stretches;
}

double Route::least_distance(const std::vector<Eigen::Vector2d>& points,
                             const std::vector<Stretch>& stretches, const Eigen::Vector2d& place) {
  double best = 1e300;
  const auto look_at = [&](const Stretch& stretch) {
    for (std::size_t i = stretch.first; i < stretch.end; ++i)
      best = std::min(best, (points[i] - place).squaredNorm());
  };
  // The nearest circle first: its points rule out most of the others.
  const auto nearest =
      std::min_element(stretches.begin(), stretches.end(), [&](const auto& one, const auto& other) {
        return (one.middle - place).squaredNorm() < (other.middle - place).squaredNorm();
      });
  if (nearest != stretches.end()) look_at(*nearest);
  for (const Stretch& stretch : stretches) {
    // The slack of a micrometre is for rounding.
    const double reach = stretch.radius_m + std::sqrt(best) + 1e-6;
    if ((stretch.middle - place).squaredNorm() < reach * reach) look_at(stretch);
  }
  return std::sqrt(best);
}

double Route::distance_to(const Eigen::Vector2d& place) const {
  return roads_.empty() ? least_distance(points_, stretches_, place)
                        : least_distance(roads_, road_stretches_, place);
}

bool Route::near(const Eigen::Vector2d& place, double distance_m) const {
  return least_distance(points_, stretches_, place) < distance_m;
}

double Route::distance_to(const Eigen::Vector2d& place, double from, double to) const {
  if (from <= 0.0 && to >= 1.0) return least_distance(points_, stretches_, place);
  const auto index = [&](double share) {
    return static_cast<std::size_t>(
        std::lround(std::clamp(share, 0.0, 1.0) * static_cast<double>(points_.size() - 1)));
  };
  const std::size_t last = index(to);
  double best = 1e300;
  for (std::size_t i = index(from); i <= last; ++i)
    best = std::min(best, (points_[i] - place).squaredNorm());
  return std::sqrt(best);
}

}  // namespace understory
