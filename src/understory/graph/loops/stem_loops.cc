#include "understory/graph/loops/stem_loops.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "understory/geometry/matrix_inverse.h"
#include "understory/graph/graph_constants.h"
#include "understory/graph/loops/view_cone.h"
#include "understory/graph/stem_matching/pair_matching.h"
#include "understory/registration/stems/tilt_about.h"
#include "understory/util/error.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace graph_constants::stem_loops;

double median_l0(const std::vector<SparsePoints>& views) {
  std::vector<double> values(views.size());
  parallel_for(views.size(), 16, [&](std::size_t i) {
    if (i % 8 == 0) values[i] = SparseTarget(views[i]).l0_m;
  });
  std::erase_if(values, [](double value) { return value <= 0.0; });
  return upper_median(std::move(values));
}

// What a single view misses of a place, or sees twice, makes its triangles unlike those of another
// day. In half of the stems one triangle in eight is whole.
std::vector<SparsePoints> gathered_views(const std::vector<SparsePoints>& views,
                                         const std::vector<Pose>& poses,
                                         const Gathering& gathering) {
  if (gathering.reach_m <= 0.0) return views;
  std::vector<SparsePoints> gathered(views.size());
  parallel_for(views.size(), 4, [&](std::size_t i) {
    gathered[i] = gather_views(views, poses, static_cast<int>(i), gathering);
  });
  return gathered;
}

TreePatterns places_of(const std::vector<SparsePoints>& views, const std::vector<Pose>& poses,
                       double l0_m, const StemLoopConfig& config) {
  TreePatterns patterns(l0_m, config.pattern);
  std::optional<Eigen::Vector3d> last;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Vector3d& at = poses[i].translation();
    if (last && (at - *last).norm() < config.place_spacing * l0_m) continue;
    last = at;
    patterns.add(static_cast<int>(i), views[i]);
  }
  patterns.finish();
  return patterns;
}

// The covariance of a loop: its own noise, and what both views got wrong alike.
Matrix6d loop_covariance(const SparseIcpResult& icp, const SparsePoints& source, double l0_m) {
  Matrix6d information = icp.information + 1e-6 * Matrix6d::Identity();
  Matrix6d covariance = kLoopVariance * inverse_matrix(information);
  const double shift = kLoopShiftL0 * l0_m;
  covariance.diagonal() +=
      (Vector6d() << 0.0, 0.0, kLoopYaw * kLoopYaw, shift * shift, shift * shift, shift * shift)
          .finished();
  return covariance + tilt_about(middle_of(source), kLoopTilt);
}

class Finder {
 public:
  Finder(const StemPath& path, const std::vector<SparsePoints>& views, double gathered_reach_m,
         const StemLoopConfig& config)
      : path_(path),
        views_(views),
        gathered_reach_m_(gathered_reach_m),
        config_(config),
        l0_m_(median_l0(views)),
        patterns_(places_of(views, path.world_from_view, l0_m_, config)) {}

  [[nodiscard]] std::optional<StemLoop> find(int query) const {
    const int before = query - config_.exclude_recent + 1;
    if (before <= 0 || l0_m_ <= 0.0) return std::nullopt;
    std::optional<StemLoop> best;
    for (const PatternCandidate& candidate : patterns_.find(view(query), before)) {
      const StemLoop loop = verify(views_, query, candidate.place, candidate.place_from_query);
      if (!best || loop.overlap > best->overlap) best = loop;
    }
    if (!best || best->overlap < kHopeless * config_.min_overlap) return best;
    return confirmed(nearest(*best));
  }

 private:
  [[nodiscard]] const SparsePoints& view(int i) const {
    return views_[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] const Pose& pose(int i) const {
    return path_.world_from_view[static_cast<std::size_t>(i)];
  }

  [[nodiscard]] StemLoop verify(const std::vector<SparsePoints>& views, int query, int match,
                                const Pose& guess) const {
    const SparsePoints& source = views[static_cast<std::size_t>(query)];
    const SparseIcpResult icp = register_sparse_icp(
        SparseTarget(views[static_cast<std::size_t>(match)]), source, guess, config_.icp);
    StemLoop loop;
    loop.query = query;
    loop.match = match;
    loop.overlap = icp.overlap;
    const double apart = icp.target_from_source.translation().norm() / config_.max_distance_m;
    loop.score = icp.overlap * std::exp(-apart * apart);
    loop.match_from_query = icp.target_from_source;
    loop.covariance = loop_covariance(icp, source, l0_m_);
    return loop;
  }

  // Whether the views overlap by that much and surely lie near enough to each other.
  [[nodiscard]] bool verified(const StemLoop& loop, double min_overlap) const {
    const Eigen::Vector3d& shift = loop.match_from_query.translation();
    const Eigen::Vector2d way = shift.head<2>().normalized();
    const double variance = way.dot(loop.covariance.block<2, 2>(3, 3) * way);
    return loop.overlap >= min_overlap &&
           shift.norm() + kSureSigmas * std::sqrt(variance) <= config_.max_distance_m;
  }

  // The view around the place that the query stands nearest to.
  [[nodiscard]] StemLoop nearest(const StemLoop& loop) const {
    const Eigen::Vector3d at = pose(loop.match) * loop.match_from_query.translation();
    int best = loop.match;
    const int last = std::min(loop.query - config_.exclude_recent, loop.match + kNeighbourhood);
    for (int j = std::max(0, loop.match - kNeighbourhood); j <= last; ++j) {
      if ((pose(j).translation() - at).norm() < (pose(best).translation() - at).norm()) best = j;
    }
    if (best == loop.match) return loop;
    const StemLoop moved = verify(views_, loop.query, best,
                                  pose(best).inverse() * pose(loop.match) * loop.match_from_query);
    return moved.overlap >= kNearestOverlap * loop.overlap ? moved : loop;
  }

  // Views laid together find a place. The two views themselves tell how they lie to each other,
  // where they have enough in common. Views that face opposite ways have not: there what was laid
  // together tells it, with the odometry's errors.
  [[nodiscard]] StemLoop confirmed(StemLoop loop) const {
    StemLoop single = verify(path_.views, loop.query, loop.match, loop.match_from_query);
    single.score = loop.score;
    single.verified = verified(single, config_.min_overlap);
    if (single.verified || gathered_reach_m_ <= 0.0) return single.verified ? single : loop;
    loop.covariance += gathered_covariance(loop.query) + gathered_covariance(loop.match);
    loop.verified = verified(loop, config_.min_gathered_overlap);
    return loop;
  }

  // Of the views laid together around one, as a whole, against that one. Of a random walk to both
  // sides the mean has a twelfth of the variance of the whole way. A view that looks to one side
  // has most stems from there, and the errors of neighbouring steps are alike.
  [[nodiscard]] Matrix6d gathered_covariance(int centre) const {
    Matrix6d sum = Matrix6d::Zero();
    const auto count = static_cast<int>(path_.world_from_view.size());
    for (const int side : {-1, 1}) {
      double way = 0.0;
      for (int k = centre; k + side >= 0 && k + side < count; k += side) {
        way += (pose(k + side).translation() - pose(k).translation()).norm();
        if (way > gathered_reach_m_) break;
        sum += path_.step_covariances[static_cast<std::size_t>(std::max(k, k + side))];
      }
    }
    return kGatheredShare * sum;
  }

  const StemPath& path_;
  const std::vector<SparsePoints>& views_;  // laid together
  double gathered_reach_m_;                 // 0: they are single ones
  const StemLoopConfig& config_;
  double l0_m_;
  TreePatterns patterns_;
};

}  // namespace

void describe(ConfigTable& table, StemLoopConfig& config) {
  table.add("exclude_recent", config.exclude_recent, {1, 1'000'000}, "",
            "views fewer than this number apart belong to the same passage and are no loop");
  table.add("place_spacing", config.place_spacing, {0.1, 100.0}, "stem spacings",
            "spacing along the path of the places that can be found again");
  table.add("max_distance_m", config.max_distance_m, {0.1, 100.0}, "m",
            "largest distance between two views of one place");
  table.add("min_overlap", config.min_overlap, {0.0, 1.0}, "",
            "least share of stems that two views have in common");
  table.add("min_gathered_overlap", config.min_gathered_overlap, {0.0, 1.0}, "",
            "the same of joined views, where two views alone have less in common");
  table.add(
      "gather_l0", config.gather_l0, {0.0, 100.0}, "stem spacings",
      "views within this distance along the path, to each side, are joined; 0: each view alone");
  table.add("gather_views", config.gather_views, {1, 1000}, "",
            "most views that are joined to each side");
  table.section("pattern", [&] { describe(table, config.pattern); });
  table.section("icp", [&] { describe(table, config.icp); });
}

std::vector<StemLoop> find_stem_loops(const StemPath& path, const StemLoopConfig& config,
                                      const ProgressSink& progress) {
  UNDERSTORY_CHECK(path.views.size() == path.world_from_view.size());
  UNDERSTORY_CHECK(path.views.size() == path.step_covariances.size());
  const double l0_m = median_l0(path.views);
  const Gathering gathering{config.gather_l0 * l0_m,
                            config.gather_views,
                            kMergeL0 * l0_m,
                            estimate_view_cone(path.views).range_m,
                            kSeenShare,
                            true};
  const std::vector<SparsePoints> gathered =
      gathered_views(path.views, path.world_from_view, gathering);
  const Finder finder(path, gathered, gathering.reach_m, config);
  std::vector<std::optional<StemLoop>> found(path.views.size());
  parallel_for(path.views.size(), 4, [&](std::size_t i) {
    progress.poll();
    found[i] = finder.find(static_cast<int>(i));
  });
  std::vector<StemLoop> loops;
  for (const std::optional<StemLoop>& loop : found) {
    if (loop) loops.push_back(*loop);
  }
  return loops;
}

}  // namespace understory
