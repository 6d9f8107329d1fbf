#include "understory/registration/test_stand.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory::testing {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

struct Ray {
  Eigen::Vector3d from;
  Eigen::Vector3d along;
};

double ground_height(const Stand& stand, double x, double y) {
  if (stand.bump_m == 0.0) return 0.0;
  const double k = 2.0 * std::numbers::pi / stand.bump_length_m;
  return stand.bump_m *
         (std::sin(k * x + 0.3) * std::cos(0.7 * k * y) + 0.5 * std::sin(0.37 * k * (x + 2.0 * y)));
}

double hit_ground(const Stand& stand, const Ray& ray, double range_m) {
  double before = 0.0;
  const double step = stand.bump_m == 0.0 ? range_m : 0.5;
  for (double s = step; s <= range_m; s += step) {
    const Eigen::Vector3d p = ray.from + s * ray.along;
    if (p.z() > ground_height(stand, p.x(), p.y())) {
      before = s;
      if (ray.along.z() > 0.0 && p.z() > 3.0 * stand.bump_m) return kNever;
      continue;
    }
    double low = before;
    double high = s;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      const Eigen::Vector3d q = ray.from + middle * ray.along;
      (q.z() > ground_height(stand, q.x(), q.y()) ? low : high) = middle;
    }
    return high;
  }
  return kNever;
}

double hit_stem(const Stem& stem, const Ray& ray) {
  const Eigen::Vector3d d = ray.along - stem.axis * stem.axis.dot(ray.along);
  const Eigen::Vector3d offset = ray.from - stem.foot;
  const Eigen::Vector3d o = offset - stem.axis * stem.axis.dot(offset);
  const double a = d.squaredNorm();
  const double b = o.dot(d);
  const double c = o.squaredNorm() - stem.radius_m * stem.radius_m;
  const double root = b * b - a * c;
  if (a < 1e-12 || root < 0.0) return kNever;
  const double s = (-b - std::sqrt(root)) / a;
  if (s < 0.0) return kNever;
  const double along = stem.axis.dot(offset + s * ray.along);
  return along < -0.5 || along > stem.length_m ? kNever : s;
}

double hit_ball(const Ball& ball, const Ray& ray, Random& random) {
  const Eigen::Vector3d o = ray.from - ball.center;
  const double b = o.dot(ray.along);
  const double root = b * b - o.squaredNorm() + ball.radius_m * ball.radius_m;
  if (root < 0.0) return kNever;
  const double s = std::max(0.0, -b - std::sqrt(root)) + random.exponential(ball.free_path_m);
  return s < -b + std::sqrt(root) ? s : kNever;
}

}  // namespace

Pattern vlp16() {
  return {};
}

Pattern os0_128() {
  return {128, 1024, -45.0, 45.0, 50.0, 0.02};
}

Stand make_stand(const StandOptions& options, std::uint64_t seed) {
  Random random(seed);
  Stand stand;
  stand.bump_m = 0.3;
  stand.roughness_m = 0.03;
  const double width = options.half_width_m;
  const double hectares = 4.0 * width * width / 1e4;
  const auto somewhere = [&] {
    for (;;) {
      const Eigen::Vector3d p(random.uniform(-width, width), random.uniform(-width, width), 0.0);
      if (p.norm() > options.clear_radius_m) return p;
    }
  };
  const auto stems = static_cast<int>(options.stems_per_hectare * hectares);
  for (int i = 0; i < stems; ++i) {
    Stem stem;
    stem.foot = somewhere();
    stem.foot.z() = ground_height(stand, stem.foot.x(), stem.foot.y());
    stem.axis =
        Eigen::Vector3d(random.normal(0.0, 0.04), random.normal(0.0, 0.04), 1.0).normalized();
    stem.radius_m = random.uniform(0.05, 0.25);
    stem.length_m = 60.0 * stem.radius_m + 4.0;
    if (options.crowns) {
      for (int k = 0; k < 2; ++k) {
        stand.balls.push_back({stem.foot + (0.65 + 0.3 * k) * stem.length_m * stem.axis,
                               4.0 * stem.radius_m + 0.8, 1.5});
      }
    }
    stand.stems.push_back(stem);
  }
  const auto bushes = static_cast<int>(options.bushes_per_hectare * hectares);
  for (int i = 0; i < bushes; ++i) {
    Ball bush{somewhere(), random.uniform(0.3, 1.0), 0.7};
    bush.center.z() = ground_height(stand, bush.center.x(), bush.center.y()) + 0.5;
    stand.balls.push_back(bush);
  }
  return stand;
}

Points scan_stand(const Stand& stand, const Pose& world_from_sensor, const Pattern& pattern,
                  std::uint64_t seed) {
  const auto columns = static_cast<std::size_t>(pattern.columns);
  const auto rings = static_cast<std::size_t>(pattern.rings);
  std::vector<Points> parts(columns);
  parallel_for(columns, 16, [&](std::size_t column) {
    Random random(seed, column);
    const double azimuth =
        2.0 * std::numbers::pi * static_cast<double>(column) / static_cast<double>(columns);
    for (std::size_t ring = 0; ring < rings; ++ring) {
      const double share = static_cast<double>(ring) / static_cast<double>(rings - 1);
      const double elevation = (pattern.low_deg + share * (pattern.high_deg - pattern.low_deg)) *
                               std::numbers::pi / 180.0;
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const Ray ray{world_from_sensor.translation(), world_from_sensor.rotation() * direction};
      double range = hit_ground(stand, ray, pattern.range_m);
      if (range < kNever) {
        const double steep = std::max(0.1, std::abs(ray.along.z()));
        range += random.normal(0.0, std::min(0.2, stand.roughness_m / steep));
      }
      for (const Stem& stem : stand.stems)
        range = std::min(range, hit_stem(stem, ray));
      for (const Ball& ball : stand.balls)
        range = std::min(range, hit_ball(ball, ray, random));
      if (!(range < pattern.range_m)) continue;
      range += random.normal(0.0, pattern.noise_m);
      if (range > 0.5) parts[column].push_back((range * direction).cast<float>());
    }
  });
  Points points;
  for (const Points& part : parts)
    points.insert(points.end(), part.begin(), part.end());
  return points;
}

Pattern small_os0() {
  Pattern pattern = os0_128();
  pattern.rings = 64;
  pattern.columns = 512;
  return pattern;
}

Points thin(const Points& points, float cube_m) {
  std::set<std::array<int, 3>> seen;
  Points kept;
  for (const Eigen::Vector3f& p : points) {
    const auto cube = [&](float v) { return static_cast<int>(std::floor(v / cube_m)); };
    if (seen.insert({cube(p.x()), cube(p.y()), cube(p.z())}).second) kept.push_back(p);
  }
  return kept;
}

Pose upright(double x, double y, double z, double yaw) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(x, y, z)};
}

}  // namespace understory::testing
