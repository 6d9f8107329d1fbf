#include "understory/registration/loam/ring_features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "understory/registration/registration_constants.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace registration_constants::ring_features;

using Ring = std::vector<std::uint32_t>;  // points of the scan, in order

// The rings with enough points, from the lowest number up.
std::vector<Ring> rings_of(const RingPoints& scan, std::size_t least) {
  std::vector<Ring> rings;
  for (std::uint32_t i = 0; i < scan.ring->size(); ++i) {
    const std::size_t ring = (*scan.ring)[i];
    if (ring >= rings.size()) rings.resize(ring + 1);
    rings[ring].push_back(i);
  }
  const auto usable = std::count_if(rings.begin(), rings.end(),
                                    [&](const Ring& ring) { return ring.size() >= least; });
  if (usable < 2) {
    throw InputError(
        "method loam", "",
        "expected scans with ring numbers; these have none (other methods do without)");
  }
  return rings;
}

// Which points of a ring can be no edges: on the far side of a jump in range, where their surface
// goes on unseen.
std::vector<char> hidden_points(const Points& ring, const RingFeaturesConfig& config) {
  std::vector<char> hidden(ring.size(), 0);
  const auto window = static_cast<std::size_t>(config.half_window);
  for (std::size_t i = 0; i + 1 < ring.size(); ++i) {
    const double step =
        static_cast<double>(ring[i + 1].norm()) - static_cast<double>(ring[i].norm());
    if (std::abs(step) < config.jump_m) continue;
    const std::size_t first = step > 0.0 ? i + 1 : i + 1 - std::min(i + 1, window);
    const std::size_t end = step > 0.0 ? std::min(i + 1 + window, ring.size()) : i + 1;
    std::fill(hidden.begin() + static_cast<std::ptrdiff_t>(first),
              hidden.begin() + static_cast<std::ptrdiff_t>(end), char{1});
  }
  return hidden;
}

// Points of a ring that may be edges, the sharpest first.
std::vector<std::size_t> sharp_points(const Points& ring, const std::vector<double>& smoothness,
                                      const RingFeaturesConfig& config) {
  const std::vector<char> hidden = hidden_points(ring, config);
  std::vector<std::size_t> sharp;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (hidden[i] == 0 && std::isfinite(smoothness[i]) && smoothness[i] > config.edge_smoothness)
      sharp.push_back(i);
  }
  sort_stably(sharp, [&](auto a, auto b) { return smoothness[a] > smoothness[b]; });
  return sharp;
}

// The features of one ring, by position in it.
std::vector<PointFeature> features_of(const Points& ring, const RingFeaturesConfig& config) {
  std::vector<PointFeature> features(ring.size(), PointFeature::kNone);
  const std::vector<double> smoothness = ring_smoothness(ring, config.half_window);
  const auto window = static_cast<std::size_t>(config.half_window);
  const auto sectors = static_cast<std::size_t>(config.sectors);
  std::vector<char> beside(ring.size(), 0);  // near an edge that is taken
  std::vector<int> taken(sectors, 0);
  for (const std::size_t i : sharp_points(ring, smoothness, config)) {
    int& in_sector = taken[i * sectors / ring.size()];
    if (beside[i] != 0 || in_sector == config.edges_per_sector) continue;
    ++in_sector;
    features[i] = PointFeature::kEdge;
    const std::size_t last = std::min(i + window, ring.size() - 1);
    for (std::size_t k = i - std::min(i, window); k <= last; ++k)
      beside[k] = 1;
  }
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (features[i] == PointFeature::kNone && smoothness[i] < config.plane_smoothness)
      features[i] = PointFeature::kPlane;
  }
  return features;
}

// Which points lie on ground, by the slope from each ring to the next one with points.
std::vector<char> ground_points(const Points& points, const RangeImage& image, double slope_deg) {
  std::vector<char> ground(points.size(), 0);
  const double most = std::tan(slope_deg * std::numbers::pi / 180.0);
  for (std::size_t ring = 1; ring < image.rings(); ++ring) {
    for (std::size_t column = 0; column < image.columns(); ++column) {
      const std::uint32_t low = image.at(image.ring_below(ring) * image.columns() + column);
      const std::uint32_t high = image.at(ring * image.columns() + column);
      if (low == RangeImage::kNoPoint || high == RangeImage::kNoPoint) continue;
      const Eigen::Vector3f step = points[high] - points[low];
      if (points[low].z() > 0.0F || points[high].z() > 0.0F) continue;
      if (static_cast<double>(std::abs(step.z())) <=
          most * static_cast<double>(step.head<2>().norm()))
        ground[low] = ground[high] = 1;
    }
  }
  return ground;
}

}  // namespace

void describe(ConfigTable& table, RingFeaturesConfig& config) {
  table.add("half_window", config.half_window, {1, 50}, "",
            "points to each side from which the smoothness of a point is found");
  table.add("edge_smoothness", config.edge_smoothness, {0.0, 10.0}, "",
            "smoothness above which a point may be an edge");
  table.add("plane_smoothness", config.plane_smoothness, {0.0, 10.0}, "",
            "smoothness below which a point lies on a plane");
  table.add("sectors", config.sectors, {1, 100}, "",
            "parts of a ring that have edges of their own");
  table.add("edges_per_sector", config.edges_per_sector, {1, 1000}, "", "most edges of one part");
  table.add("jump_m", config.jump_m, {0.01, 10.0}, "m",
            "step in range behind which points are no edges: something hides their surface");
}

std::vector<double> ring_smoothness(const Points& ring, int half_window) {
  const auto window = static_cast<std::size_t>(half_window);
  std::vector<double> smoothness(ring.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = window; i + window < ring.size(); ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t j = i - window; j <= i + window; ++j)
      sum += ring[i].cast<double>() - ring[j].cast<double>();
    const double range = std::max(static_cast<double>(ring[i].norm()), kLeastRange);
    smoothness[i] = sum.norm() / (2.0 * static_cast<double>(window) * range);
  }
  return smoothness;
}

std::vector<PointFeature> RingFeatureFinder::find(const RingPoints& scan) const {
  UNDERSTORY_CHECK(scan.points->size() == scan.ring->size());
  std::vector<PointFeature> features(scan.points->size(), PointFeature::kNone);
  const std::vector<Ring> rings =
      rings_of(scan, 2 * static_cast<std::size_t>(config_.half_window) + 1);
  parallel_for(rings.size(), 1, [&](std::size_t r) {
    Points ring;
    ring.reserve(rings[r].size());
    for (const std::uint32_t i : rings[r])
      ring.push_back((*scan.points)[i]);
    const std::vector<PointFeature> found = features_of(ring, config_);
    for (std::size_t k = 0; k < ring.size(); ++k)
      features[rings[r][k]] = found[k];
  });
  if (!ground_) return features;
  const RangeImage image(*scan.points, *scan.ring);
  const std::vector<char> ground = ground_points(*scan.points, image, config_.ground_slope_deg);
  const std::vector<char> clustered =
      clustered_points(*scan.points, image, ground, config_.clusters);
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (ground[i] != 0 && features[i] == PointFeature::kPlane)
      features[i] = PointFeature::kGround;
    else if (clustered[i] == 0)
      features[i] = PointFeature::kNone;
  }
  return features;
}

}  // namespace understory
