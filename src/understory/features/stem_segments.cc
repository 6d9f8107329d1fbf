#include "understory/features/stem_segments.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "understory/features/features_constants.h"
#include "understory/features/ground_guess.h"
#include "understory/features/ring_view.h"
#include "understory/features/stem_chain.h"
#include "understory/features/stem_score.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/rotation_between.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace features_constants::stem_segments;

// Half a turn about the x axis.
Eigen::Vector3d turned_over(const Eigen::Vector3d& v) {
  return {v.x(), -v.y(), -v.z()};
}

Scan turned_over(Scan scan) {
  for (ScanPoint& point : scan.points) {
    point.y = -point.y;
    point.z = -point.z;
  }
  return scan;
}

// The smallest turn that makes `up` the z axis; after half a turn about x where it points down.
Eigen::Matrix3d level_from(const Eigen::Vector3d& up) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  if (up.z() >= 0.0) return rotation_between(up, z).toRotationMatrix();
  return rotation_between(turned_over(up), z).toRotationMatrix() *
         Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
}

// Median and spread of the radii that the stems show by themselves.
StemChainConfig with_usual_radius(const SectionView& view, const std::vector<StemChain>& chains,
                                  StemChainConfig config) {
  std::vector<double> radii;
  for (const StemChain& chain : chains) {
    if (chain.sections.size() < 3 || chain.passed > 0) continue;
    const OwnRadius own = own_radius(view, chain);
    if (own.radius_m > 0.0 && own.sd_m < kSureRadius) radii.push_back(own.radius_m);
  }
  if (radii.size() < 5) return config;
  config.usual_radius_m = upper_median(radii);
  for (double& radius : radii)
    radius = std::abs(radius - config.usual_radius_m);
  config.radius_spread_m =
      std::clamp(kSpreadMedians * upper_median(radii), kLeastSpread, kMostSpread);
  return config;
}

// How far stems lean against up, from those that show it well; what is taken off is their own
// error.
double usual_lean(const std::vector<StemChain>& chains, double before) {
  std::vector<double> squares;
  for (const StemChain& chain : chains) {
    const double own = 0.5 * (chain.line.covariance(2, 2) + chain.line.covariance(3, 3));
    if (chain.sections.size() < 5 || chain.passed > 0 || own > kSureLean) continue;
    squares.push_back(0.5 * chain.line.state.tail<2>().squaredNorm() - own);
  }
  if (squares.size() < 8) return before;
  // Of two squared normals the mean is chi-squared with 2 degrees over 2: its median is 0.69.
  return std::clamp(std::sqrt(std::max(0.0, upper_median(squares) / kChiMedian)), kLeastLean,
                    before);
}

// A chain with what is found out about it in the end.
struct Candidate {
  StemChain chain;
  std::optional<double> ground_m;
  double ground_sd_m = 0.0;
  double score = 0.0;
};

StemSegment segment_of(const SectionView& view, double usual_radius_m, const Candidate& candidate,
                       const Eigen::Matrix3d& level_from_frame) {
  const StemChain& chain = candidate.chain;
  const auto& sections = view.sections();
  const double lowest = sections[static_cast<std::size_t>(chain.sections.front())].height_m;
  const double highest = sections[static_cast<std::size_t>(chain.sections.back())].height_m;
  const double foot = candidate.ground_m ? *candidate.ground_m : lowest;
  const Eigen::Vector3d along(chain.line.state[2], chain.line.state[3], 1.0);
  const Eigen::Vector2d place = chain.line.at(foot);
  StemSegment segment;
  segment.foot = level_from_frame.transpose() * Eigen::Vector3d(place.x(), place.y(), foot);
  segment.foot_on_ground = candidate.ground_m.has_value();
  if (candidate.ground_m) segment.foot_sd_m = candidate.ground_sd_m;
  segment.axis = (level_from_frame.transpose() * along).normalized();
  segment.lowest_m = (lowest - foot) * along.norm();
  segment.highest_m = (highest - foot) * along.norm();
  segment.radius_m = chain.radius_m;
  segment.radius_sd_m = chain.radius_sd_m;
  segment.score = candidate.score;
  if (candidate.ground_m) {
    const OwnRadius breast = own_radius(view, chain, foot + kBreastFrom, foot + kBreastTo);
    if (breast.sections >= 2 && breast.spacing_m < kFineSpacing * usual_radius_m) {
      segment.dbh_m = 2.0 * breast.radius_m;
      segment.dbh_sd_m = 2.0 * breast.sd_m;
    }
  }
  double time = 0.0;
  for (const int i : chain.sections) {
    const StemSection& section = sections[static_cast<std::size_t>(i)];
    segment.returns += section.returns;
    segment.levels_with_3 += section.returns >= 3 ? 1 : 0;
    time += static_cast<double>(section.t_ns) * section.returns;
  }
  segment.levels = static_cast<int>(chain.sections.size());
  segment.t_ns = static_cast<std::uint32_t>(std::max(0.0, time / segment.returns));
  Eigen::Matrix4d move = Eigen::Matrix4d::Identity();
  move(0, 2) = move(1, 3) = foot - chain.line.base_m;
  segment.covariance = move * chain.line.covariance * move.transpose();
  return segment;
}

// Of segments that stand at one place the better one stays.
std::vector<StemSegment> without_doubles(std::vector<StemSegment> segments) {
  sort_stably(segments,
              [](const StemSegment& a, const StemSegment& b) { return a.score > b.score; });
  std::vector<StemSegment> kept;
  for (const StemSegment& segment : segments) {
    const bool taken = std::any_of(kept.begin(), kept.end(), [&](const StemSegment& other) {
      const double near = kOnePlace + std::max(segment.radius_m, other.radius_m);
      const double middle = 0.5 * (segment.lowest_m + segment.highest_m);
      return (other.foot + middle * other.axis - segment.foot - middle * segment.axis)
                     .head<2>()
                     .squaredNorm() < near * near ||
             (other.foot - segment.foot).head<2>().squaredNorm() < near * near;
    });
    if (!taken) kept.push_back(segment);
  }
  sort_stably(kept, [](const StemSegment& a, const StemSegment& b) {
    return a.foot.head<2>().squaredNorm() < b.foot.head<2>().squaredNorm();
  });
  return kept;
}

// Chains of a view with what is usual among them.
struct Chains {
  StemChainConfig config;
  std::vector<StemChain> chains;
};

// Most chains are branches whatever the ground is like under them.
double score_without_ground(const SectionView& view, const Chains& all, const StemChain& chain) {
  return stem_score(stem_traits(view, chain, all.config, kUsualStart));
}

Chains chains_of(const SectionView& view, double min_score) {
  Chains result;
  result.chains = chain_sections(view, result.config);
  for (StemChain& chain : result.chains)
    fit_chain(view, result.config, chain);
  std::erase_if(result.chains, [&](const StemChain& chain) {
    return score_without_ground(view, result, chain) < kWorthFitting * min_score;
  });
  result.config = with_usual_radius(view, result.chains, result.config);
  result.config.slope_sd = usual_lean(result.chains, result.config.slope_sd);
  for (StemChain& chain : result.chains)
    fit_chain(view, result.config, chain);
  return result;
}

std::vector<StemSegment> segments_of(const SectionView& view, Chains& all,
                                     const std::vector<Eigen::Vector3f>& points,
                                     const Eigen::Matrix3d& level_from_frame, double min_score) {
  GroundGuess ground(points);
  std::vector<StemSegment> segments;
  for (StemChain& chain : all.chains) {
    if (score_without_ground(view, all, chain) < kWorthGround * min_score) continue;
    Candidate candidate;
    const double lowest =
        view.sections()[static_cast<std::size_t>(chain.sections.front())].height_m;
    if (const auto found = ground.at(chain.line.at(lowest))) {
      candidate.ground_m = std::min(found->height_m, lowest);
      candidate.ground_sd_m = found->sd_m;
    }
    const double above = candidate.ground_m ? lowest - *candidate.ground_m : 1.0;
    const StemTraits traits = stem_traits(view, chain, all.config, above);
    candidate.score = stem_score(traits);
    if (candidate.score < min_score) continue;
    candidate.chain = std::move(chain);
    segments.push_back(segment_of(view, all.config.usual_radius_m, candidate, level_from_frame));
    segments.back().traits = traits;
  }
  return without_doubles(std::move(segments));
}

// Robust mean of the directions of sure stems, level frame; z where there are few.
Eigen::Vector3d up_of(const SectionView& view, const Chains& all) {
  std::vector<const StemChain*> sure;
  for (const StemChain& chain : all.chains) {
    if (chain.sections.size() >= 4 && score_without_ground(view, all, chain) > kSure)
      sure.push_back(&chain);
  }
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  if (sure.size() < 5) return up;
  for (int round = 0; round < 6; ++round) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const StemChain* chain : sure) {
      const Eigen::Vector3d axis =
          Eigen::Vector3d(chain->line.state[2], chain->line.state[3], 1.0).normalized();
      const double own = 0.5 * (chain->line.covariance(2, 2) + chain->line.covariance(3, 3));
      const double variance = own + kLeanSd * kLeanSd;
      sum += axis / (variance * (1.0 + axis.cross(up).squaredNorm() / (4.0 * variance)));
    }
    up = sum.normalized();
  }
  return up;
}

// Of a lidar whose z axis points up, within 90 degrees.
StemSegments find_upright(const Scan& scan, const StemSegmentConfig& config,
                          const std::vector<std::uint8_t>& use) {
  StemSegments result;
  result.up = config.up.normalized();
  for (int round = 0;; ++round) {
    const Eigen::Matrix3d level = level_from(result.up);
    const RingView view(scan, level, config.max_range_m, use);
    result.levels = view.levels();
    result.step = view.step_rad();
    result.range_sd_m = view.range_sd_m();
    if (view.sections().empty()) return result;
    Chains all = chains_of(view, config.min_score);
    const Eigen::Vector3d up = up_of(view, all);
    result.up = level.transpose() * up;
    // Stems look for each other along the upright: a wrong one loses some.
    if (round == 0 && up.head<2>().norm() > kUpMatters) continue;
    result.usual_radius_m = all.config.usual_radius_m;
    result.stems = segments_of(view, all, view.points(), level, config.min_score);
    return result;
  }
}

}  // namespace

StemSegments find_stem_segments(const Scan& scan, const StemSegmentConfig& config,
                                const std::vector<std::uint8_t>& use) {
  if (config.up.z() >= 0.0) return find_upright(scan, config, use);
  StemSegmentConfig over = config;
  over.up = turned_over(config.up);
  StemSegments result = find_upright(turned_over(scan), over, use);
  result.up = turned_over(result.up);
  for (StemSegment& stem : result.stems) {
    stem.foot = turned_over(stem.foot);
    stem.axis = turned_over(stem.axis);
  }
  return result;
}

double standing_stems(const StemSegments& found) {
  double sum = 0.0;
  for (const StemSegment& stem : found.stems) {
    if (stem.foot_on_ground) sum += stem.score / stem.foot_sd_m;
  }
  return sum;
}

Stem stem_of(const StemSegment& segment, const Pose& body_from_points,
             const Eigen::Vector3d& up_in_points) {
  Stem stem;
  stem.point = (body_from_points * segment.foot).cast<float>();
  stem.axis = (body_from_points.rotation() * segment.axis).cast<float>();
  stem.length_m = static_cast<float>(segment.highest_m - segment.lowest_m);
  if (segment.dbh_m > 0.0 && segment.dbh_sd_m < kDiameterKnown)
    stem.dbh_m = static_cast<float>(segment.dbh_m);
  stem.score = static_cast<float>(segment.score);
  stem.radius_m = static_cast<float>(segment.radius_m);
  stem.radius_sd_m = static_cast<float>(segment.radius_sd_m);
  Eigen::Matrix3d level = Eigen::Matrix3d::Zero();
  level.topLeftCorner<2, 2>() = segment.covariance.topLeftCorner<2, 2>();
  level(2, 2) = segment.foot_sd_m * segment.foot_sd_m;
  const Eigen::Matrix3d turn =
      body_from_points.rotation_matrix() * level_from(up_in_points).transpose();
  const Eigen::Matrix3f covariance = (turn * level * turn.transpose()).cast<float>();
  stem.xx = covariance(0, 0);
  stem.xy = covariance(0, 1);
  stem.yy = covariance(1, 1);
  stem.zz = covariance(2, 2);
  return stem;
}

}  // namespace understory
