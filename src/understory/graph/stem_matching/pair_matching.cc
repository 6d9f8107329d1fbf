#include "understory/graph/stem_matching/pair_matching.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "understory/geometry/matrix_inverse.h"
#include "understory/geometry/plane/plane_grid.h"
#include "understory/graph/graph_constants.h"
#include "understory/registration/stems/tilt_about.h"
#include "understory/util/index.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace graph_constants::pair_matching;

void judge(const SparseTarget& target, const SparsePoints& source, const ConeOverlap& overlap,
           const SelfCorrectionConfig& config, PairMatch& match) {
  match.error_m = placed_error(target, source, match.j_from_i, overlap, config.pairs.outlier_ratio);
  match.overlap = overlap(Pose(), match.j_from_i);
  match.accepted = false;
  if (match.overlap < config.min_final_overlap) {
    match.reason = "too little overlap";
  } else if (!acceptable(match.error_m, match.overlap, config.pairs)) {
    match.reason = "too few stems found a partner";
  } else {
    match.accepted = true;
    match.reason.clear();
  }
}

PairMatch begin(const SparseTarget& target, const SparsePoints& source, const Pose& j_from_i,
                const ConeOverlap& overlap, const SelfCorrectionConfig& config) {
  PairMatch match;
  match.j_from_i = j_from_i;
  match.error_before_m =
      placed_error(target, source, j_from_i, overlap, config.pairs.outlier_ratio);
  return match;
}

// P0 section 1: the overlap of the views stands for the share that can match, lambda = 1 - gamma;
// of these again a share is missed or false.
double outlier_ratio_of(double overlap, double within_overlap) {
  return std::min(kMostOutliers, 1.0 - overlap * (1.0 - within_overlap));
}

void require_better(PairMatch& match) {
  // Where nothing could be measured before, anything is better.
  if (!match.accepted || std::isnan(match.error_before_m) || match.error_m < match.error_before_m)
    return;
  match.accepted = false;
  match.reason = "the error did not become smaller";
}

}  // namespace

Matrix6d match_covariance(const Matrix6d& information, const SparsePoints& source,
                          double shift_sd_m) {
  // Heights and tilt hang on feet of stems, which look higher the farther away they are.
  Matrix6d covariance = kMatchVariance * inverse_matrix(information + 1e-6 * Matrix6d::Identity());
  const double shift = shift_sd_m * shift_sd_m;
  covariance.diagonal() +=
      (Vector6d() << 0.0, 0.0, kMatchYaw * kMatchYaw, shift, shift, kMatchHeight * kMatchHeight)
          .finished();
  return covariance + tilt_about(middle_of(source), kMatchTilt);
}

PairMatch match_pair(const SparseTarget& target, const SparsePoints& source, const Pose& j_from_i,
                     const ConeOverlap& overlap, const SelfCorrectionConfig& config) {
  PairMatch match = begin(target, source, j_from_i, overlap, config);
  SparseIcpConfig icp_config = config.icp;
  icp_config.outlier_ratio =
      outlier_ratio_of(overlap(Pose(), j_from_i), config.pairs.outlier_ratio);
  SparseIcpResult icp = register_sparse_icp(target, source, j_from_i, icp_config);
  if (icp.status == SparseIcpStatus::kTooFewPoints) {
    match.reason = icp.reason;
    return match;
  }
  match.j_from_i = icp.target_from_source;
  judge(target, source, overlap, config, match);
  if (!match.accepted) {
    GoIcpConfig search = config.go_icp;
    search.outlier_ratio = icp_config.outlier_ratio;
    const GoIcpResult found = register_go_icp(target, source, j_from_i, search);
    match.by_go_icp = true;
    if (found.status == GoIcpStatus::kTooFewPoints) return match;
    icp = register_sparse_icp(target, source, found.target_from_source, icp_config);
    match.j_from_i = icp.target_from_source;
    judge(target, source, overlap, config, match);
  }
  match.outlier_ratio = icp.outlier_ratio;
  match.covariance = match_covariance(icp.information, source, kMatchShiftL0 * target.l0_m);
  require_better(match);
  return match;
}

PairMatch match_lattice_pair(const SparseTarget& target, const SparsePoints& source,
                             const Pose& j_from_i, const ConeOverlap& overlap,
                             const SelfCorrectionConfig& config) {
  PairMatch match = begin(target, source, j_from_i, overlap, config);
  GoIcpConfig search = config.go_icp;
  search.outlier_ratio = outlier_ratio_of(overlap(Pose(), j_from_i), config.pairs.outlier_ratio);
  const GoIcpResult found = register_go_icp(target, source, j_from_i, search);
  match.by_go_icp = true;
  if (found.status == GoIcpStatus::kTooFewPoints) {
    match.reason = found.reason;
    return match;
  }
  match.j_from_i = found.target_from_source;
  match.error_m = placed_error(target, source, match.j_from_i, overlap, config.pairs.outlier_ratio);
  match.overlap = found.overlap;
  match.outlier_ratio = 1.0 - found.overlap;
  const double limit_m = config.lattice.largest_error_m;
  match.accepted = match.outlier_ratio < config.lattice.largest_outlier_ratio;
  if (!match.accepted) match.reason = "too many outliers";
  if (match.accepted && limit_m > 0.0 && match.error_m > limit_m) {
    match.accepted = false;
    match.reason = "the matched stems lie too far apart";
  }
  require_better(match);
  return match;
}

namespace {

// One stem of views laid together.
struct GatheredStem {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int sights = 0;
  std::uint64_t views = 0;  // which ones see it: bits, 64 views on from the first again

  [[nodiscard]] Eigen::Vector3d mean() const { return sum / sights; }
  void add(const GatheredStem& other) {
    sum += other.sum;
    sights += other.sights;
    views |= other.views;
  }
};

SparsePoints means_of(const std::vector<GatheredStem>& stems) {
  SparsePoints means;
  for (const GatheredStem& stem : stems)
    means.push_back(stem.mean());
  return means;
}

// Of two stems that no view sees both, the one with fewer sights joins the other.
void join_split(std::vector<GatheredStem>& stems, double merge_m) {
  sort_stably(stems,
              [](const GatheredStem& a, const GatheredStem& b) { return a.sights > b.sights; });
  const SparsePoints means = means_of(stems);
  const PlaneGrid grid(means);
  std::vector<GatheredStem> joined;
  std::vector<int> index(stems.size(), -1);
  for (std::size_t t = 0; t < stems.size(); ++t) {
    int nearest = -1;
    double least_m2 = merge_m * merge_m;
    grid.around(means[t], merge_m, [&](int other) {
      if (index[at(other)] < 0) return;
      const double m2 = (means[at(other)] - means[t]).head<2>().squaredNorm();
      if (m2 < least_m2 && (joined[at(index[at(other)])].views & stems[t].views) == 0) {
        least_m2 = m2;
        nearest = index[at(other)];
      }
    });
    if (nearest >= 0) {
      joined[at(nearest)].add(stems[t]);
    } else {
      index[t] = static_cast<int>(joined.size());
      joined.push_back(stems[t]);
    }
  }
  stems = std::move(joined);
}

}  // namespace

SparsePoints gather_views(const std::vector<SparsePoints>& views,
                          const std::vector<Pose>& world_from_view, int centre,
                          const Gathering& gathering) {
  // The reach is measured along the way, so that a turn on the spot gathers all around.
  const auto last_within = [&](int step) {
    double way = 0.0;
    int k = centre;
    while (k + step >= 0 && at(k + step) < views.size()) {
      way += (world_from_view[at(k + step)].translation() - world_from_view[at(k)].translation())
                 .norm();
      if (way > gathering.reach_m) break;
      k += step;
    }
    return k;
  };
  const int first = last_within(-1);
  const int last = last_within(1);
  const int stride = std::max(1, (last - first) / (2 * gathering.max_views));
  const Pose centre_from_world = world_from_view[at(centre)].inverse();
  std::vector<GatheredStem> stems;
  SparsePoints places;  // of the views
  const int begin = centre - (centre - first) / stride * stride;
  for (int k = begin; k <= last; k += stride) {
    const Pose centre_from_view = centre_from_world * world_from_view[at(k)];
    const std::uint64_t view = std::uint64_t{1} << places.size() % 64;
    const SparsePoints means = means_of(stems);
    const PlaneGrid grid(means);
    std::vector<char> taken(means.size(), 0);
    for (const Eigen::Vector3d& point : views[at(k)]) {
      const Eigen::Vector3d here = centre_from_view * point;
      if (gathering.radius_m > 0.0 && here.head<2>().norm() > gathering.radius_m) continue;
      const auto found =
          means.empty() ? PlaneGrid::Neighbour{} : grid.nearest(here, gathering.merge_m, 0.0);
      if (found.index < 0) {
        stems.push_back({here, 1, view});
      } else if (taken[at(found.index)] == 0) {
        taken[at(found.index)] = 1;
        stems[at(found.index)].add({here, 1, view});
      }
    }
    places.push_back(centre_from_view.translation());
  }
  if (gathering.join_split) join_split(stems, gathering.merge_m);
  SparsePoints result;
  for (const GatheredStem& stem : stems) {
    const Eigen::Vector3d mean = stem.mean();
    const auto near =
        std::count_if(places.begin(), places.end(), [&](const Eigen::Vector3d& place) {
          return (mean - place).head<2>().norm() <= gathering.radius_m;
        });
    if (places.size() >= 3 && stem.sights < 2) continue;
    if (stem.sights < gathering.least_share * static_cast<double>(near)) continue;
    result.push_back(mean);
  }
  return result;
}

}  // namespace understory
