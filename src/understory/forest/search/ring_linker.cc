#include "understory/forest/search/ring_linker.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

using namespace stem_constants::ring_linker;

// A straight line through two rings, or a vertical one through one.
struct Line {
  Eigen::Vector2d at_breast = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

bool rings_agree(const Ring& a, const Ring& b) {
  const double larger = std::max(a.circle.radius_m, b.circle.radius_m);
  return std::abs(a.circle.radius_m - b.circle.radius_m) <= kSameRadius + kSameRadiusShare * larger;
}

// Rings by square of the ground.
class RingIndex {
 public:
  explicit RingIndex(const std::vector<Ring>& rings) {
    for (std::uint32_t i = 0; i < rings.size(); ++i)
      cells_.push_back({key_of(rings[i].circle.centre), i});
    std::sort(cells_.begin(), cells_.end());
  }
  // Calls visit(i) for rings of all squares within `reach` of the place, in a fixed order.
  template <typename Visit>
  void near(const Eigen::Vector2d& place, double reach, const Visit& visit) const {
    const Key low = key_of(place - Eigen::Vector2d::Constant(reach));
    const Key high = key_of(place + Eigen::Vector2d::Constant(reach));
    for (int row = low.first; row <= high.first; ++row) {
      auto it = std::lower_bound(cells_.begin(), cells_.end(), Entry{{row, low.second}, 0});
      for (; it != cells_.end() && it->first <= Key{row, high.second}; ++it)
        visit(it->second);
    }
  }

 private:
  using Key = std::pair<int, int>;  // row, column
  using Entry = std::pair<Key, std::uint32_t>;
  static Key key_of(const Eigen::Vector2d& p) {
    return {static_cast<int>(std::floor(p.y() / kRingCell)),
            static_cast<int>(std::floor(p.x() / kRingCell))};
  }
  std::vector<Entry> cells_;
};

// The line through the rings by least squares; the radius is their median.
StemFit line_through(const std::vector<const Ring*>& rings) {
  double sh = 0.0;
  double shh = 0.0;
  Eigen::Vector2d sc = Eigen::Vector2d::Zero();
  Eigen::Vector2d shc = Eigen::Vector2d::Zero();
  std::vector<double> radii;
  for (const Ring* ring : rings) {
    const double h = ring->height_m - kBreastHeight;
    sh += h;
    shh += h * h;
    sc += ring->circle.centre;
    shc += h * ring->circle.centre;
    radii.push_back(ring->circle.radius_m);
  }
  const auto n = static_cast<double>(rings.size());
  StemFit stem;
  // A weak pull towards the vertical (0.3 m of lever) keeps two neighbouring slices from leaning.
  const double spread = shh - sh * sh / n + 0.1;
  stem.slope = (shc - sh * sc / n) / spread;
  stem.centre = (sc - sh * stem.slope) / n;
  std::nth_element(radii.begin(), radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2),
                   radii.end());
  stem.radius_m = radii[radii.size() / 2];
  for (const Ring* ring : rings) {
    const Circle& c = ring->circle;
    stem.slices.push_back({static_cast<float>(ring->height_m), static_cast<float>(c.centre.x()),
                           static_cast<float>(c.centre.y()), static_cast<float>(c.radius_m),
                           static_cast<float>(c.rms_m), static_cast<float>(c.arc_deg)});
  }
  return stem;
}

class Linker {
 public:
  Linker(const std::vector<Ring>& rings, double max_lean_deg)
      : rings_(rings),
        index_(rings),
        used_(rings.size(), 0),
        lean_(std::tan(max_lean_deg * M_PI / 180.0)) {
    double low = 1e9;
    double high = -1e9;
    int slices = 0;
    for (const Ring& ring : rings) {
      low = std::min(low, ring.height_m);
      high = std::max(high, ring.height_m);
      slices = std::max(slices, ring.slice + 1);
    }
    span_m_ = std::max(0.0, high - low);
    best_in_slice_.resize(static_cast<std::size_t>(slices));
  }

  std::vector<StemFit> run(int min_slices) {
    std::vector<std::size_t> order(rings_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const double qa = rings_[a].quality();
      const double qb = rings_[b].quality();
      return qa != qb ? qa > qb : a < b;
    });
    std::vector<StemFit> stems;
    for (const std::size_t s : order) {
      if (used_[s] != 0) continue;
      const std::vector<const Ring*> rings = best_line(rings_[s], min_slices);
      used_[s] = 1;
      if (static_cast<int>(rings.size()) < min_slices) continue;
      for (const Ring* ring : rings)
        used_[static_cast<std::size_t>(ring - rings_.data())] = 1;
      stems.push_back(line_through(rings));
    }
    return stems;
  }

 private:
  // The line through `seed`, vertical or through another ring, that most slices support.
  std::vector<const Ring*> best_line(const Ring& seed, int min_slices) {
    near_.clear();
    std::size_t slices = 1;
    for (auto& entry : best_in_slice_)
      entry.second = nullptr;
    index_.near(seed.circle.centre, kBesideReach + lean_ * span_m_, [&](std::uint32_t i) {
      const Ring& ring = rings_[i];
      const double rise = std::abs(ring.height_m - seed.height_m);
      const double reach = kBesideReach + lean_ * rise;
      if (used_[i] != 0 || !rings_agree(ring, seed) ||
          (ring.circle.centre - seed.circle.centre).squaredNorm() > reach * reach) {
        return;
      }
      near_.push_back(&ring);
      auto& seen = best_in_slice_[static_cast<std::size_t>(ring.slice)].second;
      if (seen == nullptr && ring.slice != seed.slice) ++slices;
      seen = &ring;
    });
    if (static_cast<int>(slices) < min_slices) return {};
    std::vector<const Ring*> best = supporters({seed.circle.centre, {0.0, 0.0}}, seed);
    for (const Ring* other : near_) {
      if (best.size() == slices) break;  // no line can have more
      if (other->slice == seed.slice) continue;
      Line line;
      line.slope = (other->circle.centre - seed.circle.centre) / (other->height_m - seed.height_m);
      line.at_breast = seed.circle.centre + (kBreastHeight - seed.height_m) * line.slope;
      std::vector<const Ring*> support = supporters(line, seed);
      if (support.size() > best.size()) best.swap(support);
    }
    return best;
  }

  // For each slice the ring that lies best on the line.
  std::vector<const Ring*> supporters(const Line& line, const Ring& seed) {
    for (auto& entry : best_in_slice_)
      entry.second = nullptr;
    const double most = kOffLine + kOffLineShare * seed.circle.radius_m;
    for (const Ring* ring : near_) {
      const Eigen::Vector2d place = line.at_breast + (ring->height_m - kBreastHeight) * line.slope;
      const double off = (ring->circle.centre - place).squaredNorm();
      if (off > most * most) continue;
      auto& [least, best] = best_in_slice_[static_cast<std::size_t>(ring->slice)];
      if (best != nullptr && off >= least) continue;
      least = off;
      best = ring;
    }
    std::vector<const Ring*> result;
    for (const auto& [off, ring] : best_in_slice_) {
      if (ring != nullptr) result.push_back(ring);
    }
    return result;
  }

  const std::vector<Ring>& rings_;
  RingIndex index_;
  std::vector<char> used_;
  double lean_;
  double span_m_ = 0.0;
  std::vector<const Ring*> near_;
  std::vector<std::pair<double, const Ring*>> best_in_slice_;
};

}  // namespace

std::vector<StemFit> link_rings(const std::vector<Ring>& rings, int min_slices,
                                double max_lean_deg) {
  return Linker(rings, max_lean_deg).run(min_slices);
}

}  // namespace understory
