#include "understory/evaluation/trajectory_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/evaluation/association.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kLongRunM = 800.0;            // KITTI's longest segment
constexpr std::size_t kSegmentStartStep = 10;  // pairs, as KITTI's development kit

// Estimate and truth pose by pose.
struct Paired {
  std::vector<Pose> estimate;
  std::vector<Pose> truth;
};

double root_mean(double sum, std::size_t n) {
  return n == 0 ? kNan : std::sqrt(sum / static_cast<double>(n));
}

double median_of(std::vector<double> values) {
  const std::size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(middle),
                   values.end());
  const double upper = values[middle];
  if (values.size() % 2 == 1) return upper;
  return 0.5 *
         (*std::max_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(middle)) +
          upper);
}

std::vector<Eigen::Vector3d> places_of(const std::vector<Pose>& poses) {
  std::vector<Eigen::Vector3d> places;
  for (const Pose& pose : poses)
    places.push_back(pose.translation());
  return places;
}

AlignmentResult align(const Paired& paired, Alignment alignment) {
  if (alignment == Alignment::kNone) return {Pose(), true, 0.0};
  if (alignment == Alignment::kFirst) {
    return {paired.truth.front() * paired.estimate.front().inverse(), true, 0.0};
  }
  const std::vector<Eigen::Vector3d> source = places_of(paired.estimate);
  const std::vector<Eigen::Vector3d> target = places_of(paired.truth);
  return alignment == Alignment::kYaw ? align_points_yaw(source, target)
                                      : align_points_se3(source, target);
}

// The rotation of a fit with a free scale is that of the fit without.
void add_scale(const Paired& paired, TrajectoryErrors& errors) {
  const std::vector<Eigen::Vector3d> source = places_of(paired.estimate);
  const std::vector<Eigen::Vector3d> target = places_of(paired.truth);
  const Pose fit = align_points_se3(source, target).target_from_source;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& place : source)
    middle += place / static_cast<double>(source.size());
  const Eigen::Vector3d middle_in_truth = fit * middle;
  double along = 0.0;
  double own = 0.0;
  double true_size = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Eigen::Vector3d from_middle = fit.rotation() * (source[i] - middle);
    along += from_middle.dot(target[i] - middle_in_truth);
    own += from_middle.squaredNorm();
    true_size += (target[i] - middle_in_truth).squaredNorm();
  }
  constexpr double kLeastM = 0.1;  // root mean square distance from the middle
  const double least = kLeastM * kLeastM * static_cast<double>(source.size());
  if (along > 0.0 && own > least && true_size > least)
    errors.scale_percent = 100.0 * (own / along - 1.0);
}

void add_absolute(const Paired& paired, TrajectoryErrors& errors) {
  double sum = 0.0;
  double sum_plane = 0.0;
  double sum_rotation = 0.0;
  double total = 0.0;
  std::vector<double> distances;
  for (std::size_t i = 0; i < paired.truth.size(); ++i) {
    const Pose estimate = errors.truth_from_estimate * paired.estimate[i];
    const Eigen::Vector3d d = estimate.translation() - paired.truth[i].translation();
    const double angle = (paired.truth[i].inverse() * estimate).angle() * kDegPerRad;
    sum += d.squaredNorm();
    sum_plane += d.head<2>().squaredNorm();
    sum_rotation += angle * angle;
    total += d.norm();
    distances.push_back(d.norm());
  }
  const std::size_t n = distances.size();
  errors.ape_rmse_m = root_mean(sum, n);
  errors.ape_plane_rmse_m = root_mean(sum_plane, n);
  errors.ape_rotation_rmse_deg = root_mean(sum_rotation, n);
  errors.ape_mean_m = total / static_cast<double>(n);
  errors.ape_max_m = *std::max_element(distances.begin(), distances.end());
  errors.ape_median_m = median_of(std::move(distances));
}

void add_drift(const Paired& paired, TrajectoryErrors& errors) {
  const Pose first_aligned = paired.truth.front() * paired.estimate.front().inverse();
  errors.drift_end =
      first_aligned * paired.estimate.back().translation() - paired.truth.back().translation();
  errors.drift_end_m = errors.drift_end.norm();
  errors.drift_plane_m = errors.drift_end.head<2>().norm();
  errors.drift_percent =
      errors.length_m > 0.0 ? 100.0 * errors.drift_end_m / errors.length_m : kNan;
}

// Ids at which the estimate's path since the last id reaches delta; evo's filter_pairs_by_path.
std::vector<std::size_t> path_steps(const std::vector<Pose>& poses, double delta_m) {
  std::vector<std::size_t> ids = {0};
  double path = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    path += (poses[i].translation() - poses[i - 1].translation()).norm();
    if (path < delta_m) continue;
    ids.push_back(i);
    path = 0.0;
  }
  return ids;
}

RelativeError relative_error(const Paired& paired, double delta_m) {
  const std::vector<std::size_t> ids = path_steps(paired.estimate, delta_m);
  double sum = 0.0;
  double sum_rotation = 0.0;
  for (std::size_t k = 1; k < ids.size(); ++k) {
    const std::size_t i = ids[k - 1];
    const std::size_t j = ids[k];
    const Pose truth = paired.truth[i].inverse() * paired.truth[j];
    const Pose error = truth.inverse() * (paired.estimate[i].inverse() * paired.estimate[j]);
    const double angle = error.angle() * kDegPerRad;
    sum += error.translation().squaredNorm();
    sum_rotation += angle * angle;
  }
  RelativeError result;
  result.delta_m = delta_m;
  result.pairs = ids.size() - 1;
  result.translation_rmse_m = root_mean(sum, result.pairs);
  result.translation_percent = 100.0 * result.translation_rmse_m / delta_m;
  result.rotation_rmse_deg = root_mean(sum_rotation, result.pairs);
  return result;
}

std::vector<double> accumulated_path(const std::vector<Pose>& poses) {
  std::vector<double> path = {0.0};
  for (std::size_t i = 1; i < poses.size(); ++i) {
    path.push_back(path.back() + (poses[i].translation() - poses[i - 1].translation()).norm());
  }
  return path;
}

SegmentError segment_error(const Paired& paired, const std::vector<double>& path, double length) {
  SegmentError result;
  result.length_m = length;
  for (std::size_t i = 0; i < path.size(); i += kSegmentStartStep) {
    const auto end = std::upper_bound(path.begin(), path.end(), path[i] + length);
    if (end == path.end()) break;
    const auto j = static_cast<std::size_t>(end - path.begin());
    const Pose truth = paired.truth[i].inverse() * paired.truth[j];
    const Pose estimate = paired.estimate[i].inverse() * paired.estimate[j];
    const Eigen::Vector3d d =
        paired.truth[i].rotation() * (estimate.translation() - truth.translation());
    result.translation_percent += 100.0 * d.norm() / length;
    result.translation_plane_percent += 100.0 * d.head<2>().norm() / length;
    result.rotation_deg_per_m += (estimate.inverse() * truth).angle() * kDegPerRad / length;
    ++result.segments;
  }
  const double n = result.segments == 0 ? kNan : static_cast<double>(result.segments);
  result.translation_percent /= n;
  result.translation_plane_percent /= n;
  result.rotation_deg_per_m /= n;
  return result;
}

// 100, 200 ... 800 m on runs that are long enough for all of them. On shorter ones also a tenth of
// each, so that a walk round a plot has segments at all. Only lengths that occur are listed.
void add_segments(const Paired& paired, TrajectoryErrors& errors) {
  const std::vector<double> path = accumulated_path(paired.truth);
  std::vector<double> lengths;
  if (path.back() < kLongRunM) {
    for (int k = 1; k <= 8; ++k)
      lengths.push_back(10.0 * k);
  }
  for (int k = 1; k <= 8; ++k)
    lengths.push_back(100.0 * k);
  for (const double length : lengths) {
    const SegmentError segment = segment_error(paired, path, length);
    if (segment.segments > 0) errors.segments.push_back(segment);
  }
}

}  // namespace

std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& truth,
                                double tolerance_s) {
  return internal::nearest_in_time(estimate, truth, tolerance_s);
}

std::optional<TrajectoryErrors> evaluate_trajectory(const Trajectory& estimate,
                                                    const Trajectory& truth,
                                                    const EvaluationOptions& options) {
  const std::vector<PosePair> pairs = associate(estimate, truth, options.tolerance_s);
  if (pairs.empty()) return std::nullopt;
  Paired paired;
  for (const auto& [i, j] : pairs) {
    paired.estimate.push_back(estimate[i].world_from_body);
    paired.truth.push_back(truth[j].world_from_body);
  }
  TrajectoryErrors errors;
  errors.pairs = pairs.size();
  errors.alignment = options.alignment;
  const AlignmentResult alignment = align(paired, options.alignment);
  errors.truth_from_estimate = alignment.target_from_source;
  errors.alignment_determined = alignment.determined;
  errors.alignment_sd_deg = alignment.rotation_sd_deg;
  errors.length_m = path_length(truth, pairs.front().second, pairs.back().second);
  const TimeNs duration = truth.back().stamp - truth.front().stamp;
  const TimeNs common = truth[pairs.back().second].stamp - truth[pairs.front().second].stamp;
  errors.covered = duration > 0 ? to_seconds(common) / to_seconds(duration) : 1.0;
  add_absolute(paired, errors);
  add_drift(paired, errors);
  add_scale(paired, errors);
  for (const double delta : options.rpe_deltas_m) {
    UNDERSTORY_CHECK(delta > 0.0);
    errors.rpe.push_back(relative_error(paired, delta));
  }
  add_segments(paired, errors);
  return errors;
}

std::optional<Eigen::Vector3d> velocity_rmse(const std::vector<StampedVelocity>& estimate,
                                             const std::vector<StampedVelocity>& truth,
                                             const Eigen::Quaterniond& truth_from_estimate,
                                             double tolerance_s) {
  const auto pairs = internal::nearest_in_time(estimate, truth, tolerance_s);
  if (pairs.empty()) return std::nullopt;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [i, j] : pairs) {
    const Eigen::Vector3d d =
        truth_from_estimate * estimate[i].velocity_in_world - truth[j].velocity_in_world;
    sum += d.cwiseProduct(d);
  }
  return Eigen::Vector3d((sum / static_cast<double>(pairs.size())).cwiseSqrt());
}

}  // namespace understory
