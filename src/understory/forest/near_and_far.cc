#include "understory/forest/near_and_far.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <unordered_map>
#include <utility>

#include "understory/forest/near_and_far_constants.h"
#include "understory/forest/slice/slice_thinner.h"
#include "understory/forest/trees/tree_heights.h"

namespace understory {
namespace {

using namespace near_and_far_constants;

constexpr std::size_t kClasses = kClassEnds.size();  // the first one begins at zero
constexpr double kNever = std::numeric_limits<double>::infinity();

// The class of a range; nothing for one that is too long or not known.
std::optional<std::size_t> class_of(double range_m) {
  const auto* const end = std::upper_bound(kClassEnds.begin(), kClassEnds.end(), range_m);
  if (!(range_m >= 0.0) || end == kClassEnds.end()) return std::nullopt;
  return static_cast<std::size_t>(end - kClassEnds.begin());
}

// What is known of a stem's points by the ranges from which they were measured.
struct RangesOfStem {
  std::array<double, kClasses> first_s = never();  // time of the first point
  // Whole millimetres: the order of points changes no sum.
  std::array<std::int64_t, kClasses> range_sum_mm{};
  std::array<std::int64_t, kClasses> points{};

  static constexpr std::array<double, kClasses> never() {
    std::array<double, kClasses> all{};
    all.fill(kNever);
    return all;
  }
  static double mean_m(std::int64_t sum_mm, std::int64_t count) {
    return count > 0 ? 1e-3 * static_cast<double>(sum_mm) / static_cast<double>(count) : 0.0;
  }
  [[nodiscard]] double mean_range() const {
    return mean_m(std::accumulate(range_sum_mm.begin(), range_sum_mm.end(), std::int64_t{0}),
                  std::accumulate(points.begin(), points.end(), std::int64_t{0}));
  }
  // When it was first seen from nearer than a class.
  [[nodiscard]] double first_nearer(std::size_t range_class) const {
    double first = kNever;
    for (std::size_t c = 0; c < range_class; ++c)
      first = std::min(first, first_s[c]);
    return first;
  }
  [[nodiscard]] double mean_range(std::size_t range_class) const {
    return mean_m(range_sum_mm[range_class], points[range_class]);
  }
  // Whether a class shows the stem from much farther away than all points do.
  [[nodiscard]] bool is_far(std::size_t range_class) const {
    return points[range_class] >= kLeastPoints && mean_range(range_class) >= kLeastRange &&
           mean_range(range_class) >= kFarTimes * mean_range();
  }
  [[nodiscard]] bool is_seen_twice() const {
    for (std::size_t c = 1; c < kClasses; ++c)
      if (is_far(c) && first_nearer(c) < kNever) return true;
    return false;
  }
};

class NearAndFar {
 public:
  NearAndFar(const MeasuredCloud& measured, const GroundModel& ground,
             const Eigen::Vector3d& origin, const std::vector<StemFit>& stems,
             const StemDetectorConfig& config, const ProgressSink& progress)
      : measured_(measured),
        ground_(ground),
        origin_(origin),
        stems_(stems),
        config_(config),
        progress_(progress),
        ranges_(stems.size()) {}

  std::vector<StemSeenTwice> run() {
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < stems_.size(); ++i)
      all.push_back(i);
    index(all);
    take_ranges();
    index(choose(all));
    return pairs();
  }

 private:
  struct Seen {
    std::size_t stem;
    double distance_m;  // from its surface
  };

  static std::uint64_t cell_of(const Eigen::Vector2d& place) {
    const auto number = [](double metres) {
      return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(metres / kCell)));
    };
    return std::uint64_t{number(place.x())} << 32 | number(place.y());
  }

  // The stems near each square of the ground.
  void index(const std::vector<std::size_t>& chosen) {
    near_.clear();
    for (const std::size_t i : chosen) {
      const StemFit& stem = stems_[i];
      const double reach = stem.radius_m + kSurroundings + stem.slope.norm() * config_.highest_m;
      for (double x = -reach; x < reach + kCell; x += kCell) {
        for (double y = -reach; y < reach + kCell; y += kCell) {
          std::vector<std::size_t>& list = near_[cell_of(stem.centre + Eigen::Vector2d(x, y))];
          if (list.empty() || list.back() != i) list.push_back(i);
        }
      }
    }
  }

  // Calls visit(place, height, range, its class, time, stems around) for points between the heights
  // of the search that have a stem beside them.
  template <typename Visit>
  void look(const Visit& visit) const {
    std::vector<Seen> seen;
    measured_.points([&](std::span<const TimedPoint> points) {
      progress_.poll();
      for (const TimedPoint& point : points) {
        const Eigen::Vector2d place = (point.place - origin_).head<2>();
        const auto found = near_.find(cell_of(place));
        if (found == near_.end()) continue;
        const double height = ground_.height_above(point.place);
        if (!(height >= config_.lowest_m && height < config_.highest_m)) continue;
        seen.clear();
        for (const std::size_t i : found->second) {
          const double away =
              (place - stem_place_at(stems_[i], height)).norm() - stems_[i].radius_m;
          if (away < kSurroundings) seen.push_back({i, away});
        }
        if (seen.empty()) continue;
        const double range = measured_.path.range_m(point);
        if (const std::optional<std::size_t> range_class = class_of(range))
          visit(place, height, range, *range_class, point.time_s, seen);
      }
    });
  }

  void take_ranges() {
    look([&](const Eigen::Vector2d&, double, double range, std::size_t range_class, double time_s,
             const std::vector<Seen>& seen) {
      for (const Seen& near : seen) {
        if (std::abs(near.distance_m) > kOnSurface) continue;
        RangesOfStem& ranges = ranges_[near.stem];
        ranges.first_s[range_class] = std::min(ranges.first_s[range_class], time_s);
        ranges.range_sum_mm[range_class] += std::llround(1e3 * range);
        ++ranges.points[range_class];
      }
    });
  }

  [[nodiscard]] std::vector<std::size_t> choose(const std::vector<std::size_t>& all) const {
    std::vector<std::size_t> twice;
    for (const std::size_t i : all) {
      // The width of beams does not show on a stem that is as thin as the noise.
      const bool shows = !stems_[i].in_foliage && 2.0 * stems_[i].radius_m >= config_.min_dbh_m;
      if (shows && ranges_[i].is_seen_twice()) twice.push_back(i);
    }
    const std::size_t step = twice.size() / kMostStems + 1;
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < twice.size(); i += step)
      chosen.push_back(twice[i]);
    return chosen;
  }

  std::vector<StemSeenTwice> pairs() {
    std::vector<SliceThinner> thinned(kClasses, SliceThinner(config_.thin_m, kFirstLimit));
    look([&](const Eigen::Vector2d& place, double height, double, std::size_t range_class,
             double time_s, const std::vector<Seen>& seen) {
      const auto shows = [&](const Seen& near) {
        const RangesOfStem& ranges = ranges_[near.stem];
        return ranges.is_far(range_class) && time_s < ranges.first_nearer(range_class);
      };
      if (std::any_of(seen.begin(), seen.end(), shows))
        thinned[range_class].add(place.x(), place.y(), height);
    });
    std::vector<StemSeenTwice> pairs;
    for (std::size_t c = 1; c < kClasses; ++c) {
      std::vector<SlicePoint> points = thinned[c].take();
      if (points.empty()) continue;
      for (const StemFit& far : detect_stems(points, config_, {{}, origin_.head<2>()}, progress_))
        add_pair(c, far, pairs);
    }
    return pairs;
  }

  // A stem that was found from afar, beside the same one of the list.
  void add_pair(std::size_t range_class, const StemFit& far, std::vector<StemSeenTwice>& pairs) {
    const auto found = near_.find(cell_of(far.centre));
    if (found == near_.end()) return;
    double nearest = kSamePlace;
    std::optional<std::size_t> same;
    for (const std::size_t i : found->second) {
      const double away = (stems_[i].centre - far.centre).norm();
      if (away >= nearest) continue;
      nearest = away;
      same = i;
    }
    if (!same || !ranges_[*same].is_far(range_class) ||
        ranges_[*same].first_nearer(range_class) == kNever)
      return;
    const StemFit& near = stems_[*same];
    const RangesOfStem& ranges = ranges_[*same];
    pairs.push_back({*same,
                     {ranges.mean_range(), near.radius_m, near.arc_deg, near.spread_m},
                     {ranges.mean_range(range_class), far.radius_m, far.arc_deg, far.spread_m}});
  }

  const MeasuredCloud& measured_;
  const GroundModel& ground_;
  Eigen::Vector3d origin_;
  const std::vector<StemFit>& stems_;
  const StemDetectorConfig& config_;
  const ProgressSink& progress_;
  std::vector<RangesOfStem> ranges_;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> near_;
};

}  // namespace

std::vector<StemSeenTwice> look_from_afar(const MeasuredCloud& measured, const GroundModel& ground,
                                          const Eigen::Vector3d& origin,
                                          const std::vector<StemFit>& stems,
                                          const StemDetectorConfig& config,
                                          const ProgressSink& progress) {
  if (!measured.points || measured.path.empty() || stems.empty()) return {};
  return NearAndFar(measured, ground, origin, stems, config, progress).run();
}

}  // namespace understory
