#include "understory/forest/stem_detector.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include "understory/forest/circle_search.h"
#include "understory/forest/stem_fit.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// Points by square of the ground, to gather those around a stem.
class PointIndex {
 public:
  explicit PointIndex(const std::vector<SlicePoint>& points) {
    cells_.reserve(points.size());
    for (std::uint32_t i = 0; i < points.size(); ++i)
      cells_.push_back({key(cell(points[i].x), cell(points[i].y)), i});
    std::sort(cells_.begin(), cells_.end());
  }

  [[nodiscard]] std::vector<std::uint32_t> near(const Eigen::Vector2d& centre, double reach) const {
    std::vector<std::uint32_t> found;
    const int r1 = cell(static_cast<float>(centre.y() + reach));
    const int c0 = cell(static_cast<float>(centre.x() - reach));
    const int c1 = cell(static_cast<float>(centre.x() + reach));
    for (int r = cell(static_cast<float>(centre.y() - reach)); r <= r1; ++r) {
      auto it = std::lower_bound(cells_.begin(), cells_.end(), Entry{key(c0, r), 0});
      const std::uint64_t last = key(c1, r);
      for (; it != cells_.end() && it->first <= last; ++it)
        found.push_back(it->second);
    }
    return found;
  }

 private:
  using Entry = std::pair<std::uint64_t, std::uint32_t>;
  static int cell(float value) { return static_cast<int>(std::floor(value / 0.5F)); }
  static std::uint64_t key(int column, int row) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(row) + (1LL << 31)) << 32 |
           static_cast<std::uint64_t>(static_cast<std::int64_t>(column) + (1LL << 31));
  }
  std::vector<Entry> cells_;
};

// A circle with the height of its slice.
struct Ring {
  Circle circle;
  double height_m = 0.0;
  int slice = 0;
  [[nodiscard]] double quality() const { return circle.on * circle.even_deg; }
};

// One way of cutting the points: thin slices for dense clouds, thick ones for what is left of
// sparse clouds.
struct Cut {
  double thickness_m = 0.25;
  int min_slices = 3;
  double reach_m = 0.08;
  double band_m = 0.02;
};

std::vector<Ring> find_rings(const std::vector<SlicePoint>& points,
                             const std::vector<char>& explained, const Cut& cut,
                             const StemDetectorConfig& config) {
  const double span = config.highest_m - config.lowest_m;
  const auto count = static_cast<std::size_t>(std::max(1.0, std::round(span / cut.thickness_m)));
  std::vector<std::vector<Eigen::Vector2f>> slices(count);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (explained[i] != 0) continue;
    const double above = static_cast<double>(points[i].height_m) - config.lowest_m;
    if (above < 0.0 || above >= span) continue;
    const auto slice =
        std::min(count - 1, static_cast<std::size_t>(above / span * static_cast<double>(count)));
    slices[slice].emplace_back(points[i].x, points[i].y);
  }
  CircleSearchConfig search;
  search.min_radius_m = 0.4 * config.min_dbh_m;
  search.max_radius_m = 0.5 * config.max_dbh_m;
  search.reach_m = cut.reach_m;
  search.band_m = cut.band_m;
  std::vector<Ring> rings;
  for (std::size_t s = 0; s < count; ++s) {
    const double middle =
        config.lowest_m + (static_cast<double>(s) + 0.5) * span / static_cast<double>(count);
    for (const Circle& circle : find_circles(slices[s], search, hash_numbers(s, count)))
      rings.push_back({circle, middle, static_cast<int>(s)});
  }
  return rings;
}

// A straight line through two rings, or a vertical one through one.
struct Axis {
  Eigen::Vector2d at_breast = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

bool rings_agree(const Ring& a, const Ring& b) {
  const double larger = std::max(a.circle.radius_m, b.circle.radius_m);
  return std::abs(a.circle.radius_m - b.circle.radius_m) <= 0.03 + 0.3 * larger;
}

// For each slice the ring that lies best on the axis, of those that agree with `seed`.
std::vector<const Ring*> supporters(const std::vector<const Ring*>& near, const Axis& axis,
                                    const Ring& seed) {
  std::map<int, std::pair<double, const Ring*>> best;
  for (const Ring* ring : near) {
    if (!rings_agree(*ring, seed)) continue;
    const Eigen::Vector2d place = axis.at_breast + (ring->height_m - kBreastHeight) * axis.slope;
    const double off = (ring->circle.centre - place).norm();
    if (off > 0.04 + 0.2 * seed.circle.radius_m) continue;
    const auto [it, fresh] = best.try_emplace(ring->slice, off, ring);
    if (!fresh && off < it->second.first) it->second = {off, ring};
  }
  std::vector<const Ring*> result;
  for (const auto& [slice, entry] : best)
    result.push_back(entry.second);
  return result;
}

// The line through the supporters by least squares; the radius is their median.
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
  return stem;
}

// Links rings of different slices to stems, best rings first.
std::vector<StemFit> link_rings(const std::vector<Ring>& rings, const Cut& cut,
                                const StemDetectorConfig& config) {
  std::vector<std::size_t> order(rings.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const double qa = rings[a].quality();
    const double qb = rings[b].quality();
    return qa != qb ? qa > qb : a < b;
  });
  const double lean = std::tan(config.max_lean_deg * M_PI / 180.0);
  std::multimap<int, std::size_t> by_column;
  for (std::size_t i = 0; i < rings.size(); ++i)
    by_column.emplace(static_cast<int>(std::floor(rings[i].circle.centre.x())), i);
  std::vector<char> used(rings.size(), 0);
  std::vector<StemFit> stems;
  for (const std::size_t s : order) {
    if (used[s] != 0) continue;
    const Ring& seed = rings[s];
    std::vector<const Ring*> near;
    const int column = static_cast<int>(std::floor(seed.circle.centre.x()));
    const auto end = by_column.upper_bound(column + 2);
    for (auto it = by_column.lower_bound(column - 2); it != end; ++it) {
      const Ring& ring = rings[it->second];
      const double rise = std::abs(ring.height_m - seed.height_m);
      if (used[it->second] == 0 &&
          (ring.circle.centre - seed.circle.centre).norm() <= 0.05 + lean * rise) {
        near.push_back(&ring);
      }
    }
    const auto axis_to = [&](const Ring* other) {
      Axis axis;
      if (other != nullptr)
        axis.slope =
            (other->circle.centre - seed.circle.centre) / (other->height_m - seed.height_m);
      axis.at_breast = seed.circle.centre + (kBreastHeight - seed.height_m) * axis.slope;
      return axis;
    };
    std::vector<const Ring*> best = supporters(near, axis_to(nullptr), seed);
    for (const Ring* other : near) {
      if (other->slice == seed.slice) continue;
      const std::vector<const Ring*> support = supporters(near, axis_to(other), seed);
      if (support.size() > best.size()) best = support;
    }
    used[s] = 1;
    if (static_cast<int>(best.size()) < cut.min_slices) continue;
    for (const Ring* ring : best)
      used[static_cast<std::size_t>(ring - rings.data())] = 1;
    StemFit stem = line_through(best);
    for (const Ring* ring : best) {
      const Circle& c = ring->circle;
      stem.slices.push_back({static_cast<float>(ring->height_m), static_cast<float>(c.centre.x()),
                             static_cast<float>(c.centre.y()), static_cast<float>(c.radius_m),
                             static_cast<float>(c.rms_m), static_cast<float>(c.arc_deg)});
    }
    stems.push_back(stem);
  }
  return stems;
}

// How much may lie beside the surface, as the sum of both ratios of StemEvidence, for it still to
// be a stem. In a thicket it takes many slices that agree to believe in one; a steep lean is what a
// line through scattered points has.
double most_clutter(const StemFitResult& fit, double lean_deg) {
  const auto rings = static_cast<double>(fit.stem.slices.size());
  if (lean_deg > 8.0) return 0.25;
  const double limit = std::min(0.65, 0.34 + 0.085 * std::max(0.0, rings - 2.0));
  return fit.evidence.scatter_m > 0.029 && rings < 6.0 ? std::min(limit, 0.4) : limit;
}

// A slim column of points that stands alone: with a thin stem and noisy ranges its inside fills up,
// but nothing else looks like that.
bool stands_alone(const StemFitResult& fit, double slices_between, double lean_deg) {
  const StemEvidence& e = fit.evidence;
  return fit.stem.radius_m <= 0.1 && e.outside_ratio <= 0.12 && lean_deg <= 10.0 &&
         fit.stem.highest_m - fit.stem.lowest_m >= 1.5 && e.slices >= 0.85 * slices_between &&
         e.even_arc_deg >= 90.0 && e.scatter_m <= 0.4 * fit.stem.radius_m + 0.006;
}

// Is it a stem, or a bush that a cone happens to fit?
bool is_stem(const StemFitResult& fit, const Cut& cut, const StemDetectorConfig& config) {
  if (!fit.converged) return false;
  const StemFit& stem = fit.stem;
  const StemEvidence& e = fit.evidence;
  const double dbh = 2.0 * stem.radius_m;
  const double dbh_sd = 2.0 * std::sqrt(std::max(0.0, stem.covariance(2, 2)));
  const double lean_deg = std::atan(stem.slope.norm()) * 180.0 / M_PI;
  const double extent = stem.highest_m - stem.lowest_m;
  // Steep leans are rare, and a line through scattered points leans as it likes: they have to be
  // better supported.
  const double wanted_returns = config.min_returns * (1.0 + std::pow(lean_deg / 8.0, 2));
  const double slices_between = std::floor(stem.highest_m / config.slice_m) -
                                std::floor(stem.lowest_m / config.slice_m) + 1.0;
  if (dbh < config.min_dbh_m || dbh > config.max_dbh_m || lean_deg > config.max_lean_deg ||
      e.returns < wanted_returns || e.slices < config.min_slices ||
      e.slices < 0.6 * slices_between || extent < std::max(0.7, 2.0 * cut.thickness_m) ||
      stem.lowest_m > kBreastHeight + 0.3 ||  // a branch or a crown, not a stem
      stem.arc_deg < config.min_arc_deg ||
      e.even_arc_deg < std::max(0.8 * config.min_arc_deg, 0.35 * stem.arc_deg) ||
      dbh_sd > 0.01 + 0.08 * dbh) {
    return false;
  }
  if (stands_alone(fit, slices_between, lean_deg)) return true;
  // Where points are many, a stem shows in thin slices; what only thick ones show has to be clean.
  const double clutter = e.inside_ratio + e.outside_ratio;
  const bool dense = e.on > 12 * e.slices;
  if (cut.min_slices < config.min_slices && dense && (clutter > 0.25 || e.scatter_m > 0.025)) {
    return false;
  }
  return 4 * e.inside <= e.on && e.inside_ratio <= 0.35 && clutter <= most_clutter(fit, lean_deg) &&
         e.scatter_m <= std::max(0.012, 0.2 * stem.radius_m) + 0.008;
}

bool same_stem(const StemFit& a, const StemFit& b) {
  const double larger = std::max(a.radius_m, b.radius_m);
  const double smaller = std::min(a.radius_m, b.radius_m);
  // Stems do not overlap; what does so by more than the fits' errors is one stem.
  return (a.centre - b.centre).norm() < std::max(0.85 * (larger + smaller), larger + 0.3 * smaller);
}

// Keeps the best supported of stems that stand in each other.
void merge_duplicates(std::vector<StemFit>& stems) {
  std::stable_sort(stems.begin(), stems.end(), [](const StemFit& a, const StemFit& b) {
    const double qa = a.returns * a.arc_deg;
    const double qb = b.returns * b.arc_deg;
    if (qa != qb) return qa > qb;
    return a.centre.x() != b.centre.x() ? a.centre.x() < b.centre.x() : a.centre.y() < b.centre.y();
  });
  std::vector<StemFit> kept;
  for (const StemFit& stem : stems) {
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const StemFit& other) { return same_stem(stem, other); })) {
      kept.push_back(stem);
    }
  }
  stems = kept;
}

// Marks what belongs to a stem: surface, inside, and a margin.
void mark_explained(const StemFit& stem, const PointIndex& index,
                    const std::vector<SlicePoint>& points, std::vector<char>& explained) {
  for (const std::uint32_t i : index.near(stem.centre, stem.radius_m + 1.2)) {
    const AxisPlace place = place_on(stem, points[i]);
    if (place.distance_m <= stem.radius_m + 0.06) explained[i] = 1;
  }
}

}  // namespace

void describe(ConfigTable& table, StemDetectorConfig& config) {
  table.add("lowest_m", config.lowest_m, {0.1, 5.0}, "m", "stems are looked for from this height");
  table.add("highest_m", config.highest_m, {1.5, 20.0}, "m", "and up to this height");
  table.add("slice_m", config.slice_m, {0.05, 1.0}, "m", "thickness of a slice");
  table.add("thin_m", config.thin_m, {0.0, 0.1}, "m",
            "one point is kept in each cube of this size");
  table.add("min_dbh_m", config.min_dbh_m, {0.02, 1.0}, "m", "smallest diameter looked for");
  table.add("max_dbh_m", config.max_dbh_m, {0.1, 5.0}, "m", "largest diameter looked for");
  table.add("min_returns", config.min_returns, {5, 100'000}, "", "on a stem's surface");
  table.add("min_arc_deg", config.min_arc_deg, {20.0, 360.0}, "deg",
            "of the circumference that has to be seen");
  table.add("min_slices", config.min_slices, {2, 50}, "", "in which the surface has to be seen");
  table.add("max_lean_deg", config.max_lean_deg, {0.0, 60.0}, "deg", "from the vertical");
}

std::vector<StemFit> detect_stems(const std::vector<SlicePoint>& points,
                                  const StemDetectorConfig& config) {
  std::vector<SlicePoint> sorted = points;
  std::sort(sorted.begin(), sorted.end(), [](const SlicePoint& a, const SlicePoint& b) {
    if (a.x != b.x) return a.x < b.x;
    if (a.y != b.y) return a.y < b.y;
    return a.height_m != b.height_m ? a.height_m < b.height_m : a.returns < b.returns;
  });
  const PointIndex index(sorted);
  std::vector<char> explained(sorted.size(), 0);
  std::vector<StemFit> stems;
  const std::vector<Cut> cuts = {{config.slice_m, config.min_slices, 0.08, 0.02},
                                 {3.0 * config.slice_m, 2, 0.12, 0.025}};
  for (const Cut& cut : cuts) {
    const std::vector<Ring> rings = find_rings(sorted, explained, cut, config);
    const std::vector<StemFit> starts = link_rings(rings, cut, config);
    std::vector<StemFitResult> fits(starts.size());
    parallel_for(starts.size(), 1, [&](std::size_t i) {
      const StemFit& start = starts[i];
      const double reach =
          start.radius_m + 0.4 + start.slope.norm() * (config.highest_m - kBreastHeight);
      std::vector<SlicePoint> near;
      for (const std::uint32_t k : index.near(start.centre, reach)) {
        if (explained[k] == 0 && place_on(start, sorted[k]).distance_m < start.radius_m + 0.35) {
          near.push_back(sorted[k]);
        }
      }
      fits[i] = fit_stem(near, start, config);
    });
    for (const StemFitResult& fit : fits) {
      if (!is_stem(fit, cut, config)) continue;
      stems.push_back(fit.stem);
    }
    merge_duplicates(stems);
    for (const StemFit& stem : stems)
      mark_explained(stem, index, sorted, explained);
  }
  std::sort(stems.begin(), stems.end(), [](const StemFit& a, const StemFit& b) {
    return a.centre.x() != b.centre.x() ? a.centre.x() < b.centre.x() : a.centre.y() < b.centre.y();
  });
  return stems;
}

}  // namespace understory
