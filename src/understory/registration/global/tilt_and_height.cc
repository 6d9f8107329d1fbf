#include "understory/registration/global/tilt_and_height.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>

#include "understory/geometry/voxel_index.h"
#include "understory/registration/global/global_constants.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/registration/solve.h"

namespace understory {
namespace {

using namespace registration_constants::tilt_and_height;

std::uint64_t square_of(double x, double y) {
  return voxel_key(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)), 0);
}

// Line x, y over z through points, twice: the second time without what lies beside the first.
std::optional<UprightAxis> line_through(const std::vector<Eigen::Vector3d>& points) {
  UprightAxis axis;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (int round = 0; round < 3; ++round) {
    double weight = 0.0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    const auto weight_of = [&](const Eigen::Vector3d& point) {
      if (round == 0) return 1.0;
      const Eigen::Vector2d off = (point - middle).head<2>() - axis.lean * (point.z() - middle.z());
      return off.squaredNorm() < kBeside * kBeside ? 1.0 : 0.0;
    };
    std::vector<double> weights;
    for (const Eigen::Vector3d& point : points) {
      weights.push_back(weight_of(point));
      weight += weights.back();
      sum += weights.back() * point;
    }
    if (weight < kFewestPoints) return std::nullopt;
    const Eigen::Vector3d mean = sum / weight;
    double spread = 0.0;
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d d = points[i] - mean;
      spread += weights[i] * d.z() * d.z();
      slope += weights[i] * d.z() * d.head<2>();
    }
    if (spread < weight * kLeastHeightSd * kLeastHeightSd) return std::nullopt;
    middle = mean;
    axis.lean = slope / spread;
    axis.variance = kPointSd * kPointSd / spread + kLeanSd * kLeanSd;
  }
  axis.at = middle.head<2>();
  if (axis.lean.norm() > kMostLean) return std::nullopt;
  return axis;
}

// What the unknowns are: turns about x and y of the target at the source's origin, rad, and height.
struct Equations {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();

  void add(const Eigen::Vector3d& row, double residual, double weight) {
    hessian += weight * row * row.transpose();
    right += weight * residual * row;
  }
};

double cauchy(double residual_sds, double wide) {
  const double scale = kCauchy * wide;
  return 1.0 / (1.0 + residual_sds * residual_sds / (scale * scale));
}

// Leans of the stems that meet.
int add_leans(const SearchCloud& target, const SearchCloud& source, const Pose& pose, double wide,
              Equations& to) {
  const Eigen::Matrix3d rotation = pose.rotation_matrix();
  int matched = 0;
  for (const UprightAxis& axis : source.axes) {
    const Eigen::Vector2d at = (pose * Eigen::Vector3d(axis.at.x(), axis.at.y(), 0.0)).head<2>();
    const UprightAxis* partner = nullptr;
    double nearest = kMet * kMet;
    for (const UprightAxis& other : target.axes) {
      const double square = (other.at - at).squaredNorm();
      if (square >= nearest) continue;
      nearest = square;
      partner = &other;
    }
    if (partner == nullptr) continue;
    const Eigen::Vector3d along = rotation * Eigen::Vector3d(axis.lean.x(), axis.lean.y(), 1.0);
    const Eigen::Vector2d missing = partner->lean - along.head<2>() / along.z();
    const double variance = axis.variance + partner->variance;
    const double weight = cauchy(missing.norm() / std::sqrt(variance), wide) / variance;
    // A turn w adds (w.y, -w.x) to a lean.
    to.add({0.0, 1.0, 0.0}, missing.x(), weight);
    to.add({-1.0, 0.0, 0.0}, missing.y(), weight);
    ++matched;
  }
  return matched;
}

// Ground of the target by square metres, with the slope around each.
class GroundSquares {
 public:
  explicit GroundSquares(const std::vector<Eigen::Vector3d>& means) : means_(means) {
    for (std::size_t i = 0; i < means.size(); ++i)
      index_.set(square_of(means[i].x(), means[i].y()), static_cast<std::uint32_t>(i));
  }
  // Height of the ground at a place near a mean; and that mean's distance.
  struct Height {
    double z = 0.0;
    double off_m = 0.0;
  };
  [[nodiscard]] std::optional<Height> at(const Eigen::Vector3d& place) const {
    const Eigen::Vector3d* best = nullptr;
    double nearest = kNear * kNear;
    each_around(place, 1, [&](const Eigen::Vector3d& mean) {
      const double square = (mean - place).head<2>().squaredNorm();
      if (square >= nearest) return;
      nearest = square;
      best = &mean;
    });
    if (best == nullptr) return std::nullopt;
    const Eigen::Vector2d off = (place - *best).head<2>();
    return Height{best->z() + slope_at(*best).dot(off), off.norm()};
  }

 private:
  template <typename Act>
  void each_around(const Eigen::Vector3d& place, int reach, const Act& act) const {
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const std::uint32_t found = index_.find(square_of(place.x() + dx, place.y() + dy));
        if (found != VoxelIndex::kNone) act(means_[found]);
      }
    }
  }
  // Slope of a plane through what lies around, drawn to level where little does.
  [[nodiscard]] Eigen::Vector2d slope_at(const Eigen::Vector3d& place) const {
    Eigen::Matrix2d hessian = kLevelWeight * Eigen::Matrix2d::Identity();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    each_around(place, kSlopeReach, [&](const Eigen::Vector3d& mean) {
      const Eigen::Vector3d d = mean - place;
      hessian += d.head<2>() * d.head<2>().transpose();
      right += d.z() * d.head<2>();
    });
    return hessian.ldlt().solve(right);
  }

  const std::vector<Eigen::Vector3d>& means_;
  VoxelIndex index_;
};

// Where ground of both shows: the lever arm from the source's origin, and how much higher the
// target's is.
struct SharedGround {
  Eigen::Vector2d arm;
  double missing = 0.0;
  double sd = 0.0;
};

std::vector<SharedGround> shared_ground(const GroundSquares& ground, const SearchCloud& source,
                                        const Pose& pose) {
  std::vector<SharedGround> shared;
  for (const Eigen::Vector3d& mean : source.ground_means) {
    const Eigen::Vector3d at = pose * mean;
    const auto height = ground.at(at);
    if (!height) continue;
    shared.push_back({(at - pose.translation()).head<2>(), height->z - at.z(),
                      std::hypot(kGroundSd, kSlopeSd * height->off_m)});
  }
  return shared;
}

// The rise of the source that most ground speaks for.
double most_common_rise(const std::vector<SharedGround>& shared) {
  double best = 0.0;
  double most = 0.0;
  for (int step = -kRiseSteps; step <= kRiseSteps; ++step) {
    const double rise = kRiseStep * step;
    double sum = 0.0;
    for (const SharedGround& ground : shared)
      sum += cauchy((ground.missing - rise) / (kRiseStep + ground.sd), 1.0);
    if (sum <= most) continue;
    most = sum;
    best = rise;
  }
  return best;
}

void add_ground(const std::vector<SharedGround>& shared, Equations& to) {
  for (const SharedGround& ground : shared) {
    const double weight =
        kGroundShare * cauchy(ground.missing / ground.sd, 1.0) / (ground.sd * ground.sd);
    to.add({ground.arm.y(), -ground.arm.x(), 1.0}, ground.missing, weight);
  }
}

// The level frames: up of the source should be up.
void add_level(const Pose& pose, Equations& to) {
  const Eigen::Vector3d up = pose.rotation() * Eigen::Vector3d::UnitZ();
  to.add({0.0, 1.0, 0.0}, -up.x(), 1.0 / (kLevelSd * kLevelSd));
  to.add({-1.0, 0.0, 0.0}, -up.y(), 1.0 / (kLevelSd * kLevelSd));
}

Pose moved(const Pose& pose, const Eigen::Vector3d& step) {
  const Eigen::Vector3d turn(step.x(), step.y(), 0.0);
  const double angle = turn.norm();
  const Eigen::Vector3d axis =
      angle > 0.0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d::UnitX();
  const Eigen::Quaterniond by(Eigen::AngleAxisd(angle, axis));
  return {(by * pose.rotation()).normalized(),
          pose.translation() + Eigen::Vector3d(0.0, 0.0, step.z())};
}

}  // namespace

std::vector<UprightAxis> upright_axes(const std::vector<Upright>& uprights, const Points& points,
                                      const std::vector<float>& above_m) {
  VoxelIndex squares;  // the upright of each square metre, and those beside it by a list
  std::vector<std::vector<std::uint32_t>> lists;
  for (std::size_t k = 0; k < uprights.size(); ++k) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const std::uint64_t key = square_of(uprights[k].at.x() + dx, uprights[k].at.y() + dy);
        std::uint32_t found = squares.find(key);
        if (found == VoxelIndex::kNone) {
          found = static_cast<std::uint32_t>(lists.size());
          squares.set(key, found);
          lists.emplace_back();
        }
        lists[found].push_back(static_cast<std::uint32_t>(k));
      }
    }
  }
  std::vector<std::vector<Eigen::Vector3d>> around(uprights.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (above_m[i] < kLowest || above_m[i] > kHighest) continue;
    const Eigen::Vector3d point = points[i].cast<double>();
    const std::uint32_t found = squares.find(square_of(point.x(), point.y()));
    if (found == VoxelIndex::kNone) continue;
    for (const std::uint32_t k : lists[found]) {
      if ((uprights[k].at - point.head<2>()).squaredNorm() < kReach * kReach)
        around[k].push_back(point);
    }
  }
  std::vector<UprightAxis> axes;
  for (const std::vector<Eigen::Vector3d>& stem : around) {
    if (const auto axis = line_through(stem)) axes.push_back(*axis);
  }
  return axes;
}

std::vector<Eigen::Vector3d> ground_means(const Points& points, const std::vector<float>& above_m) {
  VoxelIndex squares;
  std::vector<Eigen::Vector4d> sums;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (above_m[i] > kOnGround) continue;
    const Eigen::Vector3d point = points[i].cast<double>();
    const std::uint64_t key = square_of(point.x(), point.y());
    std::uint32_t found = squares.find(key);
    if (found == VoxelIndex::kNone) {
      found = static_cast<std::uint32_t>(sums.size());
      squares.set(key, found);
      sums.emplace_back(Eigen::Vector4d::Zero());
    }
    sums[found] += Eigen::Vector4d(point.x(), point.y(), point.z(), 1.0);
  }
  std::vector<Eigen::Vector3d> means;
  for (const Eigen::Vector4d& sum : sums)
    means.emplace_back(sum.head<3>() / sum.w());
  return means;
}

TiltAndHeight fit_tilt_and_height(const SearchCloud& target, const SearchCloud& source,
                                  const Pose& start) {
  TiltAndHeight fit;
  Pose& pose = fit.target_from_source;
  pose = start;
  const GroundSquares ground(target.ground_means);
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  for (int round = 0; round < kLeanRounds + kRounds; ++round) {
    Equations at;
    const double wide = std::max(1.0, kWidest * std::pow(kNarrower, round));
    fit.axes = add_leans(target, source, pose, wide, at);
    add_level(pose, at);
    if (round >= kLeanRounds) {
      std::vector<SharedGround> shared = shared_ground(ground, source, pose);
      if (round == kLeanRounds) {
        const double rise = most_common_rise(shared);
        pose = moved(pose, {0.0, 0.0, rise});
        for (SharedGround& one : shared)
          one.missing -= rise;
      }
      add_ground(shared, at);
      fit.ground = static_cast<int>(shared.size());
    }
    hessian = at.hessian;
    at.hessian(2, 2) += kHeightFloor;
    pose = moved(pose, at.hessian.ldlt().solve(at.right));
  }
  const Eigen::Matrix3d rotation = pose.rotation_matrix();
  Eigen::Matrix<double, 3, 6> to_unknowns = Eigen::Matrix<double, 3, 6>::Zero();
  to_unknowns.block<2, 3>(0, 0) = rotation.topRows<2>();
  to_unknowns.block<1, 3>(2, 3) = rotation.row(2);
  fit.information = to_unknowns.transpose() * hessian * to_unknowns;
  return fit;
}

SparseBelief belief_of_sparse(const SearchCloud& target, const SearchCloud& source,
                              const Pose& target_from_source) {
  if (!target.few_rings && !source.few_rings) return {target_from_source, {}};
  const TiltAndHeight fit = fit_tilt_and_height(target, source, target_from_source);
  if (fit.axes < kFewestAxes) return {target_from_source, {}};
  return {fit.target_from_source, {PosePrior{fit.target_from_source, fit.information}}};
}

void count_terms(const PoseTerms& terms, double range_m, RegistrationResult& result) {
  if (!result.usable() || terms.empty()) return;
  for (const PoseTerm& term : terms) {
    if (const auto* prior = std::get_if<PosePrior>(&term)) result.information += prior->information;
  }
  result.degenerate_directions =
      internal::degenerate_directions(result.information, range_m, kDegenerateRatio);
}

}  // namespace understory
