#include "understory/simulation/scene/true_crowns.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace understory {
namespace {

constexpr double kCrownLayer = 0.25;  // metres, of the shape before it is stretched

double turn_of(const Eigen::Vector2d& from, const Eigen::Vector2d& by, const Eigen::Vector2d& to) {
  const Eigen::Vector2d a = by - from;
  const Eigen::Vector2d b = to - from;
  return a.x() * b.y() - a.y() * b.x();
}

// The vertices that make the outline of each layer.
std::vector<std::vector<Eigen::Vector3f>> outlines_of(const Shape& shape) {
  std::vector<std::vector<Eigen::Vector2d>> places;
  for (const Eigen::Vector3f& vertex : shape.vertices) {
    const auto layer = static_cast<std::size_t>(
        std::max(0.0, std::floor(static_cast<double>(vertex.z()) / kCrownLayer)));
    if (layer >= places.size()) places.resize(layer + 1);
    places[layer].push_back(vertex.head<2>().cast<double>());
  }
  std::vector<std::vector<Eigen::Vector3f>> layers(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto z = static_cast<float>((static_cast<double>(i) + 0.5) * kCrownLayer);
    for (const Eigen::Vector2d& corner : convex_outline(places[i]))
      layers[i].emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()), z);
  }
  return layers;
}

}  // namespace

// Andrew's monotone chain: the lower half of the outline, then the upper one.
std::vector<Eigen::Vector2d> convex_outline(std::vector<Eigen::Vector2d> places) {
  std::sort(places.begin(), places.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Eigen::Vector2d> corners;
  for (int half = 0; half < 2; ++half) {
    const std::size_t begin = corners.size();
    for (const Eigen::Vector2d& place : places) {
      while (corners.size() >= begin + 2 &&
             turn_of(corners[corners.size() - 2], corners.back(), place) <= 0.0)
        corners.pop_back();
      corners.push_back(place);
    }
    if (!corners.empty()) corners.pop_back();  // the other half begins with it
    std::reverse(places.begin(), places.end());
  }
  return corners;
}

double polygon_area(const std::vector<Eigen::Vector2d>& corners) {
  double twice = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& next = corners[(i + 1) % corners.size()];
    twice += corners[i].x() * next.y() - corners[i].y() * next.x();
  }
  return 0.5 * twice;
}

TrueCrowns::TrueCrowns(const StandConfig& config, std::uint64_t seed)
    : crowns_(grow_shapes(config, seed).crowns) {
  for (GrownCrown& crown : crowns_) {
    layers_.push_back(outlines_of(crown.living));
    crown.living = {};
    crown.dead = {};
  }
}

TrueCrown TrueCrowns::of(const GrownTree& tree) const {
  if (!tree.cloud.empty() || tree.broken_m > 0.0) return {};
  const std::size_t nearest = nearest_crown(crowns_, tree);
  const CrownSize& size = crowns_[nearest].size;
  const double wide = tree.crown_radius_m / size.crown_radius_m;
  const double high = tree.height_m / size.height_m;
  const auto [cosine, sine] = quarter_turn(tree.yaw_rad);
  Eigen::Matrix2d quarter;
  quarter << static_cast<double>(cosine), -static_cast<double>(sine), static_cast<double>(sine),
      static_cast<double>(cosine);
  TrueCrown crown;
  crown.base_m = size.crown_base_m * high;
  crown.volume_m3 = 0.0;
  std::vector<Eigen::Vector2d> all;
  for (const std::vector<Eigen::Vector3f>& layer : layers_[nearest]) {
    std::vector<Eigen::Vector2d> corners;
    for (const Eigen::Vector3f& corner : layer) {
      const Eigen::Vector2d side = quarter * corner.head<2>().cast<double>();
      const double height = high * static_cast<double>(corner.z());
      corners.emplace_back(wide * side + height * tree.lean);
    }
    crown.volume_m3 += polygon_area(corners) * kCrownLayer * high;
    all.insert(all.end(), corners.begin(), corners.end());
  }
  crown.area_m2 = polygon_area(convex_outline(std::move(all)));
  return crown;
}

}  // namespace understory
