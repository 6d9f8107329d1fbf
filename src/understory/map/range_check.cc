#include "understory/map/range_check.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {

void describe(ConfigTable& table, RangeCheckConfig& config) {
  table.add("enabled", config.enabled, "look for a constant error of all ranges after the run");
  table.add("max_pairs", config.max_pairs, {0, 100000}, "",
            "most pairs of views that are compared");
  table.add("apart_m", config.apart_m, {0.1, 1000.0}, "m",
            "distance between the two views of a pair");
  table.add("view_half_m", config.view_half_m, {0.0, 100.0}, "m",
            "keyframes within this distance along the path make a view");
  table.section("pair", [&] { describe(table, config.pair); });
}

namespace {

using KeyframePair = std::pair<std::size_t, std::size_t>;

double distance(const Keyframe& a, const Keyframe& b) {
  return (a.world_from_body.translation() - b.world_from_body.translation()).norm();
}

// Of one segment: each keyframe that lies half a pair's distance from the one before it begins one.
void add_pairs(std::span<const Keyframe> keyframes, std::size_t first, std::size_t end,
               const RangeCheckConfig& config, std::vector<KeyframePair>& pairs) {
  std::size_t last = end;
  for (std::size_t i = first; i < end; ++i) {
    if (last != end && distance(keyframes[last], keyframes[i]) < 0.5 * config.apart_m) continue;
    std::size_t other = i + 1;
    while (other < end && distance(keyframes[i], keyframes[other]) < config.apart_m)
      ++other;
    if (other >= end) break;
    pairs.emplace_back(i, other);
    last = i;
  }
}

}  // namespace

std::vector<KeyframePair> pairs_of_views(std::span<const Keyframe> keyframes,
                                         std::span<const std::uint64_t> segment_starts,
                                         const RangeCheckConfig& config) {
  std::vector<KeyframePair> all;
  for (std::size_t s = 0; s < segment_starts.size(); ++s) {
    const std::size_t end =
        s + 1 < segment_starts.size() ? segment_starts[s + 1] : keyframes.size();
    add_pairs(keyframes, segment_starts[s], end, config, all);
  }
  const auto most = static_cast<std::size_t>(config.max_pairs);
  if (all.size() <= most) return all;
  std::vector<KeyframePair> some;
  for (std::size_t i = 0; i < most; ++i)
    some.push_back(all[i * all.size() / most]);
  return some;
}

RangeCheck combine(const std::vector<RangeOffset>& pairs) {
  std::vector<double> offsets;
  for (const RangeOffset& pair : pairs)
    if (pair.solved) offsets.push_back(pair.offset_m);
  RangeCheck check;
  if (offsets.empty()) return check;
  // The spread between pairs beside their own: at first all of it.
  const double middle = upper_median(offsets);
  std::vector<double> away;
  for (const double offset : offsets)
    away.push_back(std::abs(offset - middle));
  const double spread = kSdOverMad * upper_median(away);
  double sum = 0.0;
  double weights = 0.0;
  double squares = 0.0;
  for (const RangeOffset& pair : pairs) {
    if (!pair.solved) continue;
    const double own = pair.sd_m * pair.sd_m + spread * spread;
    const double clipped =
        std::clamp(pair.offset_m, middle - 3.0 * std::sqrt(own), middle + 3.0 * std::sqrt(own));
    sum += clipped / own;
    weights += 1.0 / own;
    squares += (clipped - middle) * (clipped - middle) / (own * own);
  }
  check.pairs = static_cast<int>(offsets.size());
  check.offset_m = sum / weights;
  check.standard_error_m = std::max(std::sqrt(squares) / weights, 1.0 / std::sqrt(weights));
  return check;
}

namespace {

// Views around keyframes of a finished run.
class Views {
 public:
  Views(std::span<const Keyframe> keyframes, std::span<const std::uint64_t> segment_starts,
        std::vector<std::size_t> middles)
      : keyframes_(keyframes),
        segment_starts_(segment_starts),
        middles_(std::move(middles)),
        views_(middles_.size()) {}

  void make(const PointsOfKeyframe& points, const Eigen::Vector3d& lidar_in_body,
            const RangeCheckConfig& config) {
    parallel_for(middles_.size(), 1, [&](std::size_t v) {
      const std::size_t middle = middles_[v];
      const Pose view_from_world = keyframes_[middle].world_from_body.inverse();
      std::vector<std::shared_ptr<const Points>> held;
      std::vector<ViewCloud> clouds;
      for (const std::size_t i : around(middle, config.view_half_m)) {
        held.push_back(points(i));
        clouds.push_back({held.back().get(), view_from_world * keyframes_[i].world_from_body});
      }
      views_[v] = std::make_unique<SurfaceView>(clouds, lidar_in_body, config.pair.view);
    });
  }

  [[nodiscard]] const SurfaceView& at(std::size_t middle) const {
    const auto found = std::lower_bound(middles_.begin(), middles_.end(), middle);
    return *views_[static_cast<std::size_t>(found - middles_.begin())];
  }

 private:
  // Keyframes of the same segment, as far as none on the way lies farther off.
  [[nodiscard]] std::vector<std::size_t> around(std::size_t middle, double reach_m) const {
    const auto next = std::upper_bound(segment_starts_.begin(), segment_starts_.end(), middle);
    const std::size_t begin = next == segment_starts_.begin() ? 0 : *std::prev(next);
    const std::size_t end = next == segment_starts_.end() ? keyframes_.size() : *next;
    std::size_t first = middle;
    while (first > begin && distance(keyframes_[middle], keyframes_[first - 1]) <= reach_m)
      --first;
    std::vector<std::size_t> near;
    for (std::size_t i = first;
         i < end && (i <= middle || distance(keyframes_[middle], keyframes_[i]) <= reach_m); ++i)
      near.push_back(i);
    return near;
  }

  std::span<const Keyframe> keyframes_;
  std::span<const std::uint64_t> segment_starts_;
  std::vector<std::size_t> middles_;  // sorted
  std::vector<std::unique_ptr<SurfaceView>> views_;
};

std::vector<std::size_t> all_of(const std::vector<KeyframePair>& pairs) {
  std::vector<std::size_t> all;
  for (const auto& [first, second] : pairs) {
    all.push_back(first);
    all.push_back(second);
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

}  // namespace

RangeCheck check_ranges(std::span<const Keyframe> keyframes,
                        std::span<const std::uint64_t> segment_starts,
                        const PointsOfKeyframe& points, const Eigen::Vector3d& lidar_in_body,
                        const RangeCheckConfig& config) {
  if (!config.enabled) return {};
  const std::vector<KeyframePair> pairs = pairs_of_views(keyframes, segment_starts, config);
  Views views(keyframes, segment_starts, all_of(pairs));
  views.make(points, lidar_in_body, config);
  std::vector<RangeOffset> offsets(pairs.size());
  parallel_for(pairs.size(), 1, [&](std::size_t i) {
    const auto& [first, second] = pairs[i];
    const Pose guess =
        keyframes[first].world_from_body.inverse() * keyframes[second].world_from_body;
    offsets[i] =
        solve_range_offset(views.at(first), views.at(second), lidar_in_body, guess, config.pair);
  });
  return combine(offsets);
}

}  // namespace understory
