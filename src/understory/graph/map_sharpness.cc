#include "understory/graph/map_sharpness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "understory/geometry/plane/alpha_shape.h"
#include "understory/util/error.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

// {P}_epsilon of P0 (28): how many grid points of that spacing are the nearest to some point.
std::size_t occupied(const SparsePoints& map, double spacing, bool in_space) {
  if (map.empty()) return 0;
  const auto rounded = [&](const Eigen::Vector3d& p) {
    Eigen::Array3d cell = (p.array() / spacing).round();
    if (!in_space) cell.z() = 0.0;
    return cell;
  };
  Eigen::Array3d low = rounded(map.front());
  Eigen::Array3d high = low;
  for (const Eigen::Vector3d& point : map) {
    low = low.min(rounded(point));
    high = high.max(rounded(point));
  }
  const Eigen::Array3d size = high - low + 1.0;
  const auto key = [&](const Eigen::Vector3d& point) {
    const Eigen::Array3d cell = rounded(point) - low;
    return static_cast<std::uint64_t>((cell.z() * size.y() + cell.y()) * size.x() + cell.x());
  };
  constexpr double kLargestBitmap = 1 << 28;
  if (size.prod() <= kLargestBitmap) {
    std::vector<std::uint64_t> bits(static_cast<std::size_t>(size.prod()) / 64 + 1, 0);
    for (const Eigen::Vector3d& point : map) {
      const std::uint64_t k = key(point);
      bits[k / 64] |= std::uint64_t{1} << (k % 64);
    }
    return std::accumulate(bits.begin(), bits.end(), std::size_t{0},
                           [](std::size_t sum, std::uint64_t word) {
                             return sum + static_cast<std::size_t>(__builtin_popcountll(word));
                           });
  }
  std::vector<std::uint64_t> keys;
  keys.reserve(map.size());
  for (const Eigen::Vector3d& point : map)
    keys.push_back(key(point));
  std::sort(keys.begin(), keys.end());
  return static_cast<std::size_t>(std::unique(keys.begin(), keys.end()) - keys.begin());
}

double blur(const SparsePoints& map, const SharpnessConfig& config, bool in_space) {
  if (map.empty()) return 0.0;
  const double fine = static_cast<double>(occupied(map, config.fine_m, in_space));
  const double coarse = static_cast<double>(occupied(map, config.coarse_m, in_space));
  return fine / coarse * std::pow(config.fine_m / config.coarse_m, in_space ? 3 : 2);
}

struct Cluster {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  double squares = 0.0;
  int views = 0;
  std::size_t last_view = SIZE_MAX;

  [[nodiscard]] bool is_tree(int min_points) const {
    return count >= min_points && 5 * count <= 6 * views;
  }
};

// Both kinds of e_C from the sums of squares of the clusters.
void take_means(const std::vector<Cluster>& clusters, int min_points, RegistrationNoise& noise) {
  double all = 0.0;
  double all_means = 0.0;
  double all_sights = 0.0;
  double means = 0.0;
  for (const Cluster& cluster : clusters) {
    if (cluster.count < min_points) continue;
    const double rms = std::sqrt(cluster.squares / cluster.count);
    all += cluster.squares;
    all_means += rms;
    all_sights += cluster.count;
    const bool tree = cluster.is_tree(min_points);
    ++(tree ? noise.trees : noise.joined);
    means += tree ? rms : 0.0;
  }
  if (noise.trees + noise.joined == 0) return;
  noise.clusters_m = std::sqrt(all / all_sights);
  noise.clusters_mean_m = all_means / static_cast<double>(noise.trees + noise.joined);
  if (noise.trees > 0) noise.mean_m = means / static_cast<double>(noise.trees);
}

}  // namespace

SparsePoints map_points(const std::vector<SparsePoints>& views,
                        const std::vector<Pose>& map_from_view, const std::vector<char>& use) {
  UNDERSTORY_CHECK(views.size() == map_from_view.size());
  UNDERSTORY_CHECK(use.empty() || use.size() == views.size());
  std::vector<std::size_t> begin(views.size() + 1, 0);
  for (std::size_t i = 0; i < views.size(); ++i)
    begin[i + 1] = begin[i] + (use.empty() || use[i] != 0 ? views[i].size() : 0);
  SparsePoints map(begin.back());
  parallel_for(views.size(), 64, [&](std::size_t i) {
    if (begin[i + 1] == begin[i]) return;
    const Eigen::Matrix3d rotation = map_from_view[i].rotation_matrix();
    for (std::size_t k = 0; k < views[i].size(); ++k)
      map[begin[i] + k] = rotation * views[i][k] + map_from_view[i].translation();
  });
  return map;
}

double blur_ratio(const SparsePoints& map, const SharpnessConfig& config) {
  return blur(map, config, false);
}

double blur_ratio_3d(const SparsePoints& map, const SharpnessConfig& config) {
  return blur(map, config, true);
}

double box_dimension(const SparsePoints& map, const SharpnessConfig& config, bool in_space) {
  if (map.empty()) return 0.0;
  std::array<double, 4> count{};
  for (std::size_t k = 0; k < count.size(); ++k) {
    const double side = config.fine_m * static_cast<double>(1U << k);
    count[k] = std::log2(static_cast<double>(occupied(map, side, in_space)));
  }
  // Slope over fineness -0, -1, -2, -3 in powers of two, about its mean of -1.5.
  return (1.5 * count[0] + 0.5 * count[1] - 0.5 * count[2] - 1.5 * count[3]) / 5.0;
}

RegistrationNoise registration_noise(const std::vector<SparsePoints>& views,
                                     const std::vector<Pose>& map_from_view,
                                     const std::vector<char>& use, const SharpnessConfig& config) {
  const SparsePoints map = map_points(views, map_from_view, use);
  std::vector<Eigen::Vector2d> flat;
  flat.reserve(map.size());
  for (const Eigen::Vector3d& point : map)
    flat.emplace_back(point.head<2>());
  const std::vector<int> cluster_of = alpha_clusters(flat, config.alpha_radius_m);
  const auto most = std::max_element(cluster_of.begin(), cluster_of.end());
  const int count = cluster_of.empty() ? 0 : *most + 1;
  std::vector<Cluster> clusters(static_cast<std::size_t>(count));
  std::size_t place = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!use.empty() && use[v] == 0) continue;
    for (std::size_t k = 0; k < views[v].size(); ++k, ++place) {
      if (cluster_of[place] < 0) continue;
      Cluster& cluster = clusters[static_cast<std::size_t>(cluster_of[place])];
      cluster.sum += flat[place];
      ++cluster.count;
      cluster.views += cluster.last_view != v ? 1 : 0;
      cluster.last_view = v;
    }
  }
  RegistrationNoise noise;
  noise.squares_m2.assign(views.size(), 0.0);
  noise.counts.assign(views.size(), 0);
  std::size_t at = 0;
  double squares = 0.0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!use.empty() && use[v] == 0) continue;
    for (std::size_t k = 0; k < views[v].size(); ++k, ++at) {
      if (cluster_of[at] < 0) continue;
      Cluster& cluster = clusters[static_cast<std::size_t>(cluster_of[at])];
      const double squared = (flat[at] - cluster.sum / cluster.count).squaredNorm();
      cluster.squares += squared;
      if (!cluster.is_tree(config.min_points)) continue;
      squares += squared;
      noise.squares_m2[v] += squared;
      ++noise.counts[v];
      ++noise.sights;
    }
  }
  take_means(clusters, config.min_points, noise);
  if (noise.sights > 0) noise.pooled_m = std::sqrt(squares / static_cast<double>(noise.sights));
  return noise;
}

MapSharpness map_sharpness(const std::vector<SparsePoints>& views,
                           const std::vector<Pose>& map_from_view, const std::vector<char>& use,
                           const SharpnessConfig& config) {
  const SparsePoints map = map_points(views, map_from_view, use);
  const RegistrationNoise noise = registration_noise(views, map_from_view, use, config);
  MapSharpness result;
  result.beta = blur_ratio(map, config);
  result.beta_3d = blur_ratio_3d(map, config);
  result.dimension = box_dimension(map, config, false);
  result.dimension_3d = box_dimension(map, config, true);
  result.cluster_noise_m = noise.clusters_m;
  result.cluster_noise_mean_m = noise.clusters_mean_m;
  result.noise_m = noise.pooled_m;
  result.noise_mean_m = noise.mean_m;
  result.trees = noise.trees;
  result.joined = noise.joined;
  return result;
}

std::vector<char> views_worth_keeping(const RegistrationNoise& noise, double factor,
                                      double max_share) {
  std::vector<char> keep(noise.counts.size(), 1);
  if (factor <= 0.0) return keep;
  std::vector<double> means;
  std::vector<std::pair<double, std::size_t>> worst;
  for (std::size_t v = 0; v < noise.counts.size(); ++v) {
    if (noise.counts[v] == 0) continue;
    means.push_back(noise.squares_m2[v] / noise.counts[v]);
    worst.emplace_back(means.back(), v);
  }
  const double limit = factor * upper_median(means);
  std::erase_if(worst, [&](const auto& view) { return view.first <= limit; });
  std::sort(worst.begin(), worst.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second < b.second;
  });
  const auto most = static_cast<std::size_t>(max_share * static_cast<double>(keep.size()));
  for (std::size_t k = 0; k < std::min(most, worst.size()); ++k)
    keep[worst[k].second] = 0;
  return keep;
}

}  // namespace understory
