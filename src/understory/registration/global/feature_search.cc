#include "understory/registration/global/feature_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "understory/geometry/voxel_index.h"
#include "understory/registration/global/global_constants.h"
#include "understory/registration/global/level_cloud.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace registration_constants::feature_search;

// Points by cells of the plane as wide as a spin image.
class PlaneCells {
 public:
  explicit PlaneCells(const Points& points) : points_(points), next_(points.size(), kNone) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::uint64_t key = key_of(points[i], 0, 0);
      const std::uint32_t first = first_.find(key);
      if (first != VoxelIndex::kNone) next_[i] = first;
      first_.set(key, static_cast<std::uint32_t>(i));
    }
  }
  // Calls act(offset from a place) for the points within the radius of a spin image in the plane.
  template <typename Act>
  void around(const Eigen::Vector3f& at, const Act& act) const {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        for (std::uint32_t i = first_.find(key_of(at, dx, dy)); i != kNone; i = next_[i]) {
          const Eigen::Vector3f away = points_[i] - at;
          if (away.head<2>().squaredNorm() < kRadius * kRadius) act(away);
        }
      }
    }
  }

 private:
  static constexpr std::uint32_t kNone = VoxelIndex::kNone;
  static std::uint64_t key_of(const Eigen::Vector3f& at, int dx, int dy) {
    return voxel_key(voxel_floor(at.x() / kRadius) + dx, voxel_floor(at.y() / kRadius) + dy, 0);
  }

  const Points& points_;
  VoxelIndex first_;
  std::vector<std::uint32_t> next_;
};

// What stands around a place, as it lies in the plane.
struct PlaneSpread {
  double count = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d products = Eigen::Matrix2d::Zero();

  void add(const Eigen::Vector2d& d) {
    count += 1.0;
    sum += d;
    products += d * d.transpose();
  }
  // Neither plain ground nor the middle of a plain wall.
  [[nodiscard]] bool stands_out() const {
    if (count < kFewestAround) return false;
    const Eigen::Vector2d mean = sum / count;
    if (mean.norm() > kEndShare * static_cast<double>(kNear)) return true;  // an end
    const Eigen::Matrix2d spread = products / count - mean * mean.transpose();
    const double half = 0.5 * spread.trace();
    const double root = std::sqrt(std::max(0.0, half * half - spread.determinant()));
    return half - root > kCornerRatio * (half + root);  // the narrow variance over the wide one
  }
};

LocalFeature feature_at(const PlaneCells& cells, const Eigen::Vector3f& at, bool& stands_out) {
  LocalFeature feature;
  feature.at = at.cast<double>();
  PlaneSpread spread;
  cells.around(at, [&](const Eigen::Vector3f& away) {
    const float radius = away.head<2>().norm();
    if (radius < kNear && std::abs(away.z()) < kNear) spread.add(away.head<2>().cast<double>());
    const auto ring = static_cast<std::size_t>(radius / kRadius * LocalFeature::kRadii);
    const float height = (away.z() - kLowest) / (kHighest - kLowest) * LocalFeature::kHeights;
    if (!(height >= 0.0F && height < static_cast<float>(LocalFeature::kHeights))) return;
    // A ring's share of the area would let the outer ones count most.
    feature.image[ring * LocalFeature::kHeights + static_cast<std::size_t>(height)] +=
        1.0F / (2.0F * static_cast<float>(ring) + 1.0F);
  });
  float squared = 0.0F;
  for (float& value : feature.image) {
    value = std::sqrt(value);  // few points of far things weigh as those of near ones
    squared += value * value;
  }
  for (float& value : feature.image)
    value /= std::sqrt(std::max(squared, 1e-12F));
  stands_out = spread.stands_out();
  return feature;
}

float alike(const LocalFeature& a, const LocalFeature& b) {
  float sum = 0.0F;
  for (std::size_t k = 0; k < a.image.size(); ++k)
    sum += a.image[k] * b.image[k];
  return sum;
}

std::vector<std::size_t> most_alike(const std::vector<LocalFeature>& of,
                                    const std::vector<LocalFeature>& among) {
  std::vector<std::size_t> best(of.size(), 0);
  for (std::size_t i = 0; i < of.size(); ++i) {
    float most = -1.0F;
    for (std::size_t j = 0; j < among.size(); ++j) {
      const float now = alike(of[i], among[j]);
      if (now > most) {
        most = now;
        best[i] = j;
      }
    }
  }
  return best;
}

// Two features that look alike.
struct Correspondence {
  Eigen::Vector3d target;
  Eigen::Vector3d source;
};

std::vector<Correspondence> correspondences(const std::vector<LocalFeature>& target,
                                            const std::vector<LocalFeature>& source) {
  const std::vector<std::size_t> there = most_alike(source, target);
  const std::vector<std::size_t> back = most_alike(target, source);
  std::vector<Correspondence> found;
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (back[there[i]] == i) found.push_back({target[there[i]].at, source[i].at});
  }
  return found;
}

// Which correspondences a rigid motion about z can bring onto each other together.
class Consistency {
 public:
  explicit Consistency(const std::vector<Correspondence>& pairs)
      : words_(pairs.size() / 64 + 1), bits_(pairs.size() * words_), degree_(pairs.size(), 0) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      for (std::size_t j = i + 1; j < pairs.size(); ++j) {
        const Eigen::Vector3d a = pairs[j].target - pairs[i].target;
        const Eigen::Vector3d b = pairs[j].source - pairs[i].source;
        const double length = b.head<2>().norm();
        if (length < kShortest || std::abs(a.head<2>().norm() - length) > kSameLength ||
            std::abs(a.z() - b.z()) > kSameRise)
          continue;
        set(i, j);
        set(j, i);
      }
    }
  }
  [[nodiscard]] int degree(std::size_t i) const { return degree_[i]; }
  [[nodiscard]] bool holds(std::size_t i, std::size_t j) const {
    return (bits_[i * words_ + j / 64] >> (j % 64) & 1U) != 0;
  }
  // Correspondences that are consistent with both.
  [[nodiscard]] int common(std::size_t i, std::size_t j) const {
    int sum = 0;
    for (std::size_t w = 0; w < words_; ++w)
      sum += std::popcount(bits_[i * words_ + w] & bits_[j * words_ + w]);
    return sum;
  }

 private:
  void set(std::size_t i, std::size_t j) {
    bits_[i * words_ + j / 64] |= std::uint64_t{1} << (j % 64);
    ++degree_[i];
  }

  std::size_t words_;
  std::vector<std::uint64_t> bits_;
  std::vector<int> degree_;
};

// Least squares of a turn about z and a shift.
Pose fitted(const std::vector<Correspondence>& pairs, const std::vector<std::size_t>& chosen) {
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const std::size_t i : chosen) {
    a += pairs[i].target / static_cast<double>(chosen.size());
    b += pairs[i].source / static_cast<double>(chosen.size());
  }
  double sine = 0.0;
  double cosine = 0.0;
  for (const std::size_t i : chosen) {
    const Eigen::Vector3d p = pairs[i].target - a;
    const Eigen::Vector3d q = pairs[i].source - b;
    cosine += q.x() * p.x() + q.y() * p.y();
    sine += q.x() * p.y() - q.y() * p.x();
  }
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(std::atan2(sine, cosine), Eigen::Vector3d::UnitZ()));
  return {turn, a - turn * b};
}

std::vector<std::size_t> within(const std::vector<Correspondence>& pairs, const Pose& pose) {
  std::vector<std::size_t> near;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if ((pose * pairs[i].source - pairs[i].target).norm() < kReach) near.push_back(i);
  }
  return near;
}

// The fit that begins with one correspondence and those that agree with it best.
FeatureMatch fit_from(const std::vector<Correspondence>& pairs, const Consistency& consistency,
                      std::size_t seed) {
  std::vector<std::pair<int, std::size_t>> friends;
  for (std::size_t j = 0; j < pairs.size(); ++j) {
    if (consistency.holds(seed, j)) friends.emplace_back(-consistency.common(seed, j), j);
  }
  std::sort(friends.begin(), friends.end());
  friends.resize(std::min(friends.size(), kFriends));
  std::vector<std::size_t> chosen = {seed};
  for (const auto& [common, j] : friends)
    chosen.push_back(j);
  FeatureMatch match;
  for (int round = 0; round < kRounds && chosen.size() >= 2; ++round) {
    match.target_from_source = fitted(pairs, chosen);
    chosen = within(pairs, match.target_from_source);
  }
  match.matched = static_cast<int>(chosen.size());
  return match;
}

bool is_known(const std::vector<FeatureMatch>& found, const FeatureMatch& match) {
  return std::any_of(found.begin(), found.end(), [&](const FeatureMatch& other) {
    const Pose step = other.target_from_source.inverse() * match.target_from_source;
    return step.translation().norm() < kSamePlace && step.angle() < kSameTurn;
  });
}

}  // namespace

std::vector<LocalFeature> find_local_features(const Points& points,
                                              const std::vector<float>& above_m, std::size_t most) {
  Points high;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (above_m[i] > kAbove) high.push_back(points[i]);
  }
  const PlaneCells cells(high);
  std::vector<LocalFeature> features;
  for (const Eigen::Vector3f& at : voxel_means(high, kSpacing)) {
    bool stands_out = false;
    const LocalFeature feature = feature_at(cells, at, stands_out);
    if (stands_out) features.push_back(feature);
  }
  if (features.size() <= most) return features;
  std::vector<LocalFeature> some;
  for (std::size_t i = 0; i < most; ++i)
    some.push_back(features[i * features.size() / most]);
  return some;
}

std::vector<FeatureMatch> match_local_features(const std::vector<LocalFeature>& target,
                                               const std::vector<LocalFeature>& source,
                                               std::size_t most) {
  if (target.empty() || source.empty()) return {};
  const std::vector<Correspondence> pairs = correspondences(target, source);
  const Consistency consistency(pairs);
  std::vector<std::size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  sort_stably(order, [&](std::size_t a, std::size_t b) {
    return consistency.degree(a) > consistency.degree(b);
  });
  order.resize(std::min(order.size(), kSeeds));
  std::vector<FeatureMatch> fits;
  for (const std::size_t seed : order) {
    const FeatureMatch match = fit_from(pairs, consistency, seed);
    if (match.matched >= kFewestMatched) fits.push_back(match);
  }
  sort_stably(fits,
              [](const FeatureMatch& a, const FeatureMatch& b) { return a.matched > b.matched; });
  std::vector<FeatureMatch> found;
  for (const FeatureMatch& match : fits) {
    if (found.size() >= most) break;
    if (!is_known(found, match)) found.push_back(match);
  }
  return found;
}

}  // namespace understory
