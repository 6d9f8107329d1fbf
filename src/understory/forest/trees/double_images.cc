#include "understory/forest/trees/double_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "understory/forest/double_image_constants.h"
#include "understory/geometry/plane/plane_grid.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace double_image_constants;
using Eigen::Vector2d;

// Two stems that may be images of one tree.
struct ImagePair {
  std::size_t a = 0;
  std::size_t b = 0;
  Vector2d apart = Vector2d::Zero();  // from a to b, metres
  Vector2d middle = Vector2d::Zero();
};

// Places of the plane, by their neighbours.
class Places {
 public:
  explicit Places(const std::vector<Vector2d>& places) : grid_(raised(places)) {}

  // The `most` nearest within `reach_m`, the nearest first.
  [[nodiscard]] std::vector<std::size_t> near(const Vector2d& place, double reach_m,
                                              std::size_t most) const {
    const Eigen::Vector3d at(place.x(), place.y(), 0.0);
    std::vector<std::pair<double, std::size_t>> found;
    grid_.around(at, reach_m, [&](int other) {
      const auto j = static_cast<std::size_t>(other);
      const double distance = (grid_.points()[j] - at).norm();
      if (distance <= reach_m) found.emplace_back(distance, j);
    });
    std::sort(found.begin(), found.end());
    if (found.size() > most) found.resize(most);
    std::vector<std::size_t> indices;
    for (const auto& [distance, j] : found)
      indices.push_back(j);
    return indices;
  }

 private:
  static SparsePoints raised(const std::vector<Vector2d>& places) {
    SparsePoints points;
    for (const Vector2d& place : places)
      points.emplace_back(place.x(), place.y(), 0.0);
    return points;
  }

  PlaneGrid grid_;
};

bool are_alike(const StemFit& a, const StemFit& b) {
  const double difference = std::abs(a.radius_m - b.radius_m);
  const double variance = std::max(0.0, a.covariance(2, 2)) + std::max(0.0, b.covariance(2, 2));
  return difference <=
         std::max(kAlikeShare * 0.5 * (a.radius_m + b.radius_m), kAlikeSds * std::sqrt(variance));
}

// Each stem with its nearest alike one, once.
std::vector<ImagePair> pairs_of(const std::vector<StemFit>& stems, const Places& places) {
  std::vector<ImagePair> pairs;
  for (std::size_t i = 0; i < stems.size(); ++i) {
    std::size_t nearest = i;
    for (const std::size_t j : places.near(stems[i].centre, kMostApart, stems.size())) {
      if (j == i || !are_alike(stems[i], stems[j])) continue;
      nearest = j;
      break;
    }
    if (nearest == i) continue;
    const ImagePair pair{std::min(i, nearest), std::max(i, nearest),
                         stems[std::max(i, nearest)].centre - stems[std::min(i, nearest)].centre,
                         0.5 * (stems[i].centre + stems[nearest].centre)};
    pairs.push_back(pair);
  }
  std::sort(pairs.begin(), pairs.end(), [](const ImagePair& one, const ImagePair& other) {
    return std::pair(one.a, one.b) < std::pair(other.a, other.b);
  });
  pairs.erase(std::unique(pairs.begin(), pairs.end(),
                          [](const ImagePair& one, const ImagePair& other) {
                            return one.a == other.a && one.b == other.b;
                          }),
              pairs.end());
  return pairs;
}

// Whether most pairs nearby lie apart by the same vector, forwards or backwards.
bool agrees(const std::vector<ImagePair>& pairs, const Places& middles, std::size_t i) {
  std::vector<std::size_t> near = middles.near(pairs[i].middle, kReach, kMostNear + 1);
  std::erase(near, i);
  const Vector2d& apart = pairs[i].apart;
  const double tolerance = std::max(kAgree, kAgreeShare * apart.norm());
  const auto alike =
      static_cast<std::size_t>(std::count_if(near.begin(), near.end(), [&](std::size_t j) {
        return std::min((pairs[j].apart - apart).norm(), (pairs[j].apart + apart).norm()) <
               tolerance;
      }));
  return alike >= kFewestAgreeing && 2 * alike > near.size();
}

// Whether a third stem goes on where the pair ends. Trees planted in narrow rows do so.
bool goes_on(const std::vector<StemFit>& stems, const Places& places, const ImagePair& pair) {
  const double tolerance = kRowShare * pair.apart.norm();
  const auto any_at = [&](std::size_t from, const Vector2d& step) {
    return !places.near(stems[from].centre + step, tolerance, 1).empty();
  };
  return any_at(pair.b, pair.apart) || any_at(pair.a, -pair.apart);
}

void find_twins(const std::vector<StemFit>& stems, DoubleImages& images) {
  std::vector<Vector2d> centres;
  for (const StemFit& stem : stems)
    centres.push_back(stem.centre);
  const Places places(centres);
  std::vector<ImagePair> pairs = pairs_of(stems, places);
  std::erase_if(pairs, [&](const ImagePair& pair) { return goes_on(stems, places, pair); });
  std::vector<Vector2d> middle_points;
  for (const ImagePair& pair : pairs)
    middle_points.push_back(pair.middle);
  const Places middles(middle_points);
  // A tree has two images at most.
  std::vector<int> in_pairs(stems.size(), 0);
  for (const ImagePair& pair : pairs) {
    ++in_pairs[pair.a];
    ++in_pairs[pair.b];
  }
  std::vector<double> apart;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const ImagePair& pair = pairs[i];
    if (in_pairs[pair.a] > 1 || in_pairs[pair.b] > 1 || !agrees(pairs, middles, i)) continue;
    images.twice[pair.a] = images.twice[pair.b] = 1;
    images.trees += 2;
    apart.push_back(pair.apart.norm());
  }
  images.apart_m = upper_median(apart);
}

// All pairs of alike stems farther apart than `kMostApart`, each with its vector to one side.
std::vector<ImagePair> far_pairs_of(const std::vector<StemFit>& stems, const Places& places) {
  std::vector<ImagePair> pairs;
  for (std::size_t i = 0; i < stems.size(); ++i) {
    for (const std::size_t j : places.near(stems[i].centre, kFarApart, stems.size())) {
      const Vector2d apart = stems[j].centre - stems[i].centre;
      const bool to_one_side = apart.x() > 0.0 || (apart.x() == 0.0 && apart.y() > 0.0);
      if (to_one_side && apart.norm() > kMostApart && are_alike(stems[i], stems[j]))
        pairs.push_back({i, j, apart, Vector2d::Zero()});
    }
  }
  return pairs;
}

// Pairs by an offset that they share, of stems that have one image there.
std::vector<ImagePair> images_at(const std::vector<ImagePair>& pairs,
                                 const std::vector<std::size_t>& chosen, std::size_t stems) {
  std::vector<int> in_pairs(stems, 0);
  for (const std::size_t k : chosen) {
    ++in_pairs[pairs[k].a];
    ++in_pairs[pairs[k].b];
  }
  // In rows of trees each one has a neighbour before and behind.
  std::vector<ImagePair> images;
  for (const std::size_t k : chosen) {
    if (in_pairs[pairs[k].a] == 1 && in_pairs[pairs[k].b] == 1) images.push_back(pairs[k]);
  }
  return images;
}

// Root mean square difference of the radii of two trees taken at random.
double usual_difference_m(const std::vector<StemFit>& stems) {
  double sum = 0.0;
  double squares = 0.0;
  for (const StemFit& stem : stems) {
    sum += stem.radius_m;
    squares += stem.radius_m * stem.radius_m;
  }
  const auto count = static_cast<double>(stems.size());
  return std::sqrt(std::max(0.0, 2.0 * (squares / count - sum * sum / (count * count))));
}

// Whether these pairs, of one offset, are images of most trees.
bool are_images(const std::vector<ImagePair>& pairs, const std::vector<StemFit>& stems) {
  const double trees = 2.0 * static_cast<double>(pairs.size());
  if (pairs.size() < kFewestTwice || trees < kFarShare * static_cast<double>(stems.size()))
    return false;
  double squares = 0.0;
  for (const ImagePair& pair : pairs) {
    const double difference = stems[pair.a].radius_m - stems[pair.b].radius_m;
    squares += difference * difference;
  }
  const double alike = std::sqrt(squares / static_cast<double>(pairs.size()));
  return alike < kFarAlike * usual_difference_m(stems);
}

// A cloud that was laid on itself far off. The offsets that most pairs share are tried, the fullest
// first: in planted stands rows share one as well.
void find_far_twins(const std::vector<StemFit>& stems, DoubleImages& images) {
  std::vector<Vector2d> centres;
  for (const StemFit& stem : stems)
    centres.push_back(stem.centre);
  std::vector<ImagePair> pairs = far_pairs_of(stems, Places(centres));
  for (int tried = 0; tried < kMostOffsets && pairs.size() >= kFewestTwice; ++tried) {
    std::vector<Vector2d> vectors;
    for (const ImagePair& pair : pairs)
      vectors.push_back(pair.apart);
    const Places offsets(vectors);
    std::vector<std::size_t> fullest;
    for (const Vector2d& apart : vectors) {
      std::vector<std::size_t> near = offsets.near(apart, kFarAgree, pairs.size());
      if (near.size() > fullest.size()) fullest = std::move(near);
    }
    const std::vector<ImagePair> found = images_at(pairs, fullest, stems.size());
    if (!are_images(found, stems)) {
      const Vector2d middle = pairs[fullest.front()].apart;
      std::erase_if(pairs, [&](const ImagePair& pair) {
        return (pair.apart - middle).norm() < 2.0 * kFarAgree;
      });
      continue;
    }
    std::vector<double> apart;
    for (const ImagePair& pair : found) {
      images.twice[pair.a] = images.twice[pair.b] = 1;
      apart.push_back(pair.apart.norm());
    }
    images.trees = 2 * found.size();
    images.apart_m = upper_median(apart);
    return;
  }
}

// How far two scans lie apart by the mean outline of stems. 0: not clearly.
double apart_by_outlines(const std::vector<const StemFit*>& stems) {
  const auto count = static_cast<double>(stems.size());
  Vector2d mean = Vector2d::Zero();
  double radius = 0.0;
  for (const StemFit* stem : stems) {
    mean += stem->oval / count;
    radius += stem->radius_m / count;
  }
  double squares = 0.0;
  for (const StemFit* stem : stems)
    squares += (stem->oval - mean).squaredNorm();
  const double sd = std::sqrt(squares / (2.0 * count * (count - 1.0)));
  const double apart = mean.norm() / kOvalPerApart;
  return mean.norm() > kClearSds * sd && apart > kLeastOval + kGrownShare * 2.0 * radius ? apart
                                                                                         : 0.0;
}

void find_ovals(const std::vector<StemFit>& stems, DoubleImages& images) {
  // Those seen all round come first.
  std::vector<std::size_t> order(stems.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto end = std::stable_partition(order.begin(), order.end(),
                                         [&](std::size_t i) { return stems[i].oval.allFinite(); });
  images.round = static_cast<std::size_t>(end - order.begin());
  std::vector<Vector2d> round;
  for (std::size_t k = 0; k < images.round; ++k)
    round.push_back(stems[order[k]].centre);
  const Places places(round);
  std::vector<double> apart;
  for (std::size_t k = 0; k < order.size(); ++k) {
    std::vector<const StemFit*> near;
    for (const std::size_t other : places.near(stems[order[k]].centre, kReach, kMostNear))
      near.push_back(&stems[order[other]]);
    if (near.size() < kFewestRound) continue;
    const double oval_m = apart_by_outlines(near);
    images.oval_m[order[k]] = oval_m;
    if (oval_m > 0.0 && k < images.round) apart.push_back(oval_m);
  }
  images.oval = apart.size();
  images.oval_apart_m = upper_median(apart);
}

}  // namespace

std::string complaint_of(const DoubleImages& images) {
  const std::size_t stems = images.twice.size();
  const auto share = [](std::size_t part, std::size_t whole) {
    return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
  };
  if (images.trees >= kFewestTwice && share(images.trees, stems) >= kTwiceShare)
    return fmt::format(
        "{} of {} trees stand twice in the cloud, {:.0f} cm apart, all in the same direction: its "
        "scans do not lie on each other",
        images.trees, stems, 100.0 * images.apart_m);
  if (images.oval >= kFewestRound && share(images.oval, images.round) >= kOvalShare)
    return fmt::format(
        "{} stems are longer in one direction than across, all in the same: scans lie {:.0f} cm "
        "apart, and diameters may be too large",
        images.oval, 100.0 * images.oval_apart_m);
  return {};
}

DoubleImages find_double_images(const std::vector<StemFit>& stems) {
  DoubleImages images;
  images.twice.assign(stems.size(), 0);
  images.oval_m.assign(stems.size(), 0.0);
  find_twins(stems, images);
  if (complaint_of(images).empty()) find_far_twins(stems, images);
  find_ovals(stems, images);
  return images;
}

}  // namespace understory
