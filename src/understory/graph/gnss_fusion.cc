#include "understory/graph/gnss_fusion.h"

#include <gtsam/inference/Symbol.h>
#include <gtsam/linear/NoiseModel.h>
#include <gtsam/nonlinear/LevenbergMarquardtOptimizer.h>
#include <gtsam/nonlinear/Marginals.h>
#include <gtsam/nonlinear/NonlinearFactor.h>
#include <gtsam/slam/PoseTranslationPrior.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/graph/graph_constants.h"
#include "understory/graph/pose_graph_factors.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace graph_constants::gnss_fusion;

using Eigen::Vector3d;
using gtsam::symbol_shorthand::B;  // the receiver's slow error
using Jacobian = boost::optional<gtsam::Matrix&>;

Vector3d scale_of(const GnssObservation& observation) {
  return {observation.plane_scale, observation.plane_scale, observation.height_scale};
}

// A position of the antenna: that of the keyframe with the lever arm, plus the slow error.
class PositionFactor : public gtsam::NoiseModelFactor2<gtsam::Pose3, Vector3d> {
 public:
  PositionFactor(const GnssObservation& observation, gtsam::Key bias,
                 const gtsam::SharedNoiseModel& noise)
      : NoiseModelFactor2(noise, static_cast<gtsam::Key>(observation.keyframe), bias),
        antenna_(observation.antenna_in_keyframe),
        position_(observation.position_in_enu),
        scale_(scale_of(observation)),
        axes_(observation.has_height ? 3 : 2) {}

  gtsam::Vector evaluateError(const gtsam::Pose3& pose, const Vector3d& bias, Jacobian by_pose,
                              Jacobian by_bias) const override {
    gtsam::Matrix36 by_motion;
    const Vector3d antenna = pose.transformFrom(antenna_, by_motion);
    if (by_pose) *by_pose = by_motion.topRows(axes_);
    if (by_bias) *by_bias = gtsam::Matrix3(scale_.asDiagonal()).topRows(axes_);
    return (antenna + scale_.cwiseProduct(bias) - position_).head(axes_);
  }

 private:
  Vector3d antenna_;
  Vector3d position_;
  Vector3d scale_;     // of the slow error
  Eigen::Index axes_;  // east, north, and up where it is measured
};

// Where a direction of a keyframe points in the plane.
class AzimuthFactor : public gtsam::NoiseModelFactor1<gtsam::Pose3> {
 public:
  AzimuthFactor(const GnssObservation& observation, const gtsam::SharedNoiseModel& noise)
      : NoiseModelFactor1(noise, static_cast<gtsam::Key>(observation.keyframe)),
        direction_(observation.direction_in_keyframe),
        azimuth_(observation.azimuth_rad) {}

  gtsam::Vector evaluateError(const gtsam::Pose3& pose, Jacobian by_pose) const override {
    const Eigen::Matrix3d rotation = pose.rotation().matrix();
    const Vector3d v = rotation * direction_;
    if (by_pose) {
      const Eigen::RowVector3d by_v =
          Eigen::RowVector3d(-v.y(), v.x(), 0.0) / v.head<2>().squaredNorm();
      *by_pose = gtsam::Matrix::Zero(1, 6);
      by_pose->leftCols(3) = -by_v * rotation * skew(direction_);
    }
    return gtsam::Vector1(
        std::remainder(std::atan2(v.y(), v.x()) - azimuth_, 2.0 * std::numbers::pi));
  }

 private:
  Vector3d direction_;
  double azimuth_;
};

// One step of a Gauss-Markov process.
class DecayFactor : public gtsam::NoiseModelFactor2<Vector3d, Vector3d> {
 public:
  DecayFactor(gtsam::Key from, gtsam::Key to, double decay, const gtsam::SharedNoiseModel& noise)
      : NoiseModelFactor2(noise, from, to), decay_(decay) {}

  gtsam::Vector evaluateError(const Vector3d& from, const Vector3d& to, Jacobian by_from,
                              Jacobian by_to) const override {
    if (by_from) *by_from = -decay_ * gtsam::Matrix3::Identity();
    if (by_to) *by_to = gtsam::Matrix3::Identity();
    return to - decay_ * from;
  }

 private:
  double decay_;
};

gtsam::SharedNoiseModel diagonal(double plane, double height) {
  return gtsam::noiseModel::Diagonal::Sigmas(Vector3d(plane, plane, height));
}

// The graph of one call.
class Fusion {
 public:
  Fusion(const std::vector<GnssObservation>& observations, const GnssErrors& errors,
         const GnssFusionConfig& config)
      : observations_(observations), errors_(errors), config_(config) {
    for (const GnssObservation& observation : observations)
      nodes_.push_back(node_of(observation.stamp));
  }

  void add_biases(gtsam::NonlinearFactorGraph& graph, gtsam::Values& first) const {
    if (nodes_.empty()) return;
    const auto slow = diagonal(errors_.slow_plane_m, errors_.slow_height_m);
    std::vector<std::int64_t> nodes = nodes_;
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      first.insert(key_of(nodes[i]), Vector3d(Vector3d::Zero()));
      if (i == 0) {
        graph.addPrior(key_of(nodes[i]), Vector3d(Vector3d::Zero()), slow);
        continue;
      }
      const double step = static_cast<double>(nodes[i] - nodes[i - 1]) * config_.bias_interval_s;
      const double decay = std::exp(-step / errors_.correlation_s);
      const double share = std::sqrt(1.0 - decay * decay);
      graph.emplace_shared<DecayFactor>(
          key_of(nodes[i - 1]), key_of(nodes[i]), decay,
          diagonal(share * errors_.slow_plane_m, share * errors_.slow_height_m));
    }
  }

  void add_positions(gtsam::NonlinearFactorGraph& graph) const {
    const auto kernel = gtsam::noiseModel::mEstimator::Cauchy::Create(config_.kernel_sigmas);
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      graph.emplace_shared<PositionFactor>(
          observations_[i], key_of(nodes_[i]),
          gtsam::noiseModel::Robust::Create(kernel, noise_of(observations_[i])));
    }
  }

  void add_headings(gtsam::NonlinearFactorGraph& graph) const {
    const auto kernel = gtsam::noiseModel::mEstimator::Cauchy::Create(config_.kernel_sigmas);
    for (const GnssObservation& observation : observations_) {
      if (!std::isfinite(observation.azimuth_rad)) continue;
      const auto noise = gtsam::noiseModel::Isotropic::Sigma(1, observation.azimuth_sd_rad);
      graph.emplace_shared<AzimuthFactor>(observation,
                                          gtsam::noiseModel::Robust::Create(kernel, noise));
    }
  }

  // Residuals and weights at the solution.
  void judge(const gtsam::Values& values, GnssFusionResult& result) const {
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      const GnssObservation& observation = observations_[i];
      const Pose& pose = result.enu_from_keyframe[static_cast<std::size_t>(observation.keyframe)];
      const Vector3d residual =
          observation.position_in_enu - pose * observation.antenna_in_keyframe;
      const Vector3d slow = values.at<Vector3d>(key_of(nodes_[i]));
      const Vector3d fast = residual - scale_of(observation).cwiseProduct(slow);
      const gtsam::SharedNoiseModel noise = noise_of(observation);
      const gtsam::Vector axes = fast.head(static_cast<Eigen::Index>(noise->dim()));
      const double sigmas = noise->whiten(axes).norm() / config_.kernel_sigmas;
      result.residual.push_back(residual);
      result.weight.push_back(1.0 / (1.0 + sigmas * sigmas));
    }
  }

 private:
  [[nodiscard]] std::int64_t node_of(TimeNs stamp) const {
    const double since = to_seconds(stamp - observations_.front().stamp);
    return static_cast<std::int64_t>(std::floor(since / config_.bias_interval_s));
  }
  [[nodiscard]] gtsam::Key key_of(std::int64_t node) const {
    return B(static_cast<std::uint64_t>(node - nodes_.front()));
  }
  [[nodiscard]] gtsam::SharedNoiseModel noise_of(const GnssObservation& observation) const {
    const double plane =
        std::hypot(observation.plane_scale * errors_.fast_plane_m, observation.extra_plane_m);
    if (!observation.has_height) return gtsam::noiseModel::Isotropic::Sigma(2, plane);
    return diagonal(plane, std::hypot(observation.height_scale * errors_.fast_height_m,
                                      observation.extra_height_m));
  }

  const std::vector<GnssObservation>& observations_;
  const GnssErrors& errors_;
  const GnssFusionConfig& config_;
  std::vector<std::int64_t> nodes_;  // of the slow error, one per observation
};

// The vertical of the first keyframe, which neither odometry nor positions on a line tell, and its
// height where no position has one. Its heading and its place in the plane are free.
void add_first_pose(gtsam::NonlinearFactorGraph& graph, const Pose& enu_from_first,
                    bool has_heights, const GnssFusionConfig& config) {
  const Vector3d up = enu_from_first.rotation().conjugate() * Vector3d::UnitZ();
  add_tilt(graph, {0, up, config.tilt_sd_deg * std::numbers::pi / 180.0});
  if (has_heights) return;
  constexpr double kFree = 1e4;  // m
  graph.emplace_shared<gtsam::PoseTranslationPrior<gtsam::Pose3>>(
      gtsam::Key{0}, enu_from_first.translation(), diagonal(kFree, 1.0));
}

// The error of a keyframe's place, over keyframes that are spread along the path.
double expected_error_m(const gtsam::Marginals& marginals, std::size_t keyframes) {
  const std::size_t step = std::max<std::size_t>(1, keyframes / kKeyframesOfExpectedError);
  double squares = 0.0;
  double count = 0.0;
  for (std::size_t k = 0; k < keyframes; k += step) {
    squares += marginals.marginalCovariance(k).bottomRightCorner<3, 3>().trace();
    count += 1.0;
  }
  return std::sqrt(squares / count);
}

// Logarithm of the determinant of a noise's square root information.
double log_root_information(const gtsam::SharedNoiseModel& noise) {
  const auto robust = boost::dynamic_pointer_cast<gtsam::noiseModel::Robust>(noise);
  const auto& of = robust ? robust->noise() : noise;
  const auto gaussian = boost::dynamic_pointer_cast<gtsam::noiseModel::Gaussian>(of);
  return gaussian ? gaussian->R().diagonal().array().abs().log().sum() : 0.0;
}

double log_evidence(const gtsam::NonlinearFactorGraph& graph, const gtsam::Values& values) {
  double evidence = -graph.error(values);
  evidence -= graph.linearize(values)->eliminateMultifrontal()->logDeterminant();
  for (const auto& factor : graph) {
    if (const auto noisy = boost::dynamic_pointer_cast<gtsam::NoiseModelFactor>(factor))
      evidence += log_root_information(noisy->noiseModel());
  }
  return evidence;
}

void check(const PoseGraphProblem& problem, const std::vector<GnssObservation>& observations,
           const GnssErrors& errors, const GnssFusionConfig& config) {
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const int keyframe = observations[i].keyframe;
    UNDERSTORY_CHECK(keyframe >= 0 &&
                     keyframe < static_cast<int>(problem.world_from_keyframe.size()));
    UNDERSTORY_CHECK(observations[i].plane_scale > 0.0 && observations[i].height_scale > 0.0 &&
                     observations[i].position_in_enu.allFinite() &&
                     observations[i].azimuth_sd_rad > 0.0);
    UNDERSTORY_CHECK(i == 0 || observations[i - 1].stamp <= observations[i].stamp);
  }
  UNDERSTORY_CHECK(errors.fast_plane_m > 0.0 && errors.fast_height_m > 0.0 &&
                   errors.slow_plane_m > 0.0 && errors.slow_height_m > 0.0 &&
                   errors.correlation_s > 0.0 && config.bias_interval_s > 0.0);
}

}  // namespace

void describe(ConfigTable& table, GnssFusionConfig& config) {
  table.add("bias_interval_s", config.bias_interval_s, {0.5, 600.0}, "s",
            "time between two values of the receiver's slow error");
  table.add("kernel_sigmas", config.kernel_sigmas, {0.5, 100.0}, "",
            "positions that are off by more standard deviations count less");
  table.add("relative_tolerance", config.relative_tolerance, {1e-12, 0.1}, "",
            "stop when the cost falls by less than this share");
  table.add("max_iterations", config.max_iterations, {1, 1000}, "", "iterations at most");
}

GnssFusionResult fuse_gnss(const PoseGraphProblem& problem, const std::vector<char>& loop_used,
                           const std::vector<GnssObservation>& observations,
                           const Pose& enu_from_world, const GnssErrors& errors,
                           const GnssFusionConfig& config) {
  check(problem, observations, errors, config);
  GnssFusionResult result;
  gtsam::Values first;
  for (std::size_t k = 0; k < problem.world_from_keyframe.size(); ++k) {
    result.enu_from_keyframe.push_back(enu_from_world * problem.world_from_keyframe[k]);
    first.insert(k, to_gtsam(result.enu_from_keyframe.back()));
  }
  if (observations.empty() || result.enu_from_keyframe.empty()) {
    result.reason = "no positions by satellites";
    return result;
  }
  const Fusion fusion(observations, errors, config);
  gtsam::NonlinearFactorGraph graph = build_graph(problem, loop_used);
  add_first_pose(graph, result.enu_from_keyframe.front(),
                 std::any_of(observations.begin(), observations.end(),
                             [](const GnssObservation& each) { return each.has_height; }),
                 config);
  fusion.add_biases(graph, first);
  fusion.add_positions(graph);
  fusion.add_headings(graph);
  try {
    PoseGraphConfig solver;
    solver.max_iterations = config.max_iterations;
    solver.relative_tolerance = config.relative_tolerance;
    gtsam::LevenbergMarquardtOptimizer optimiser(graph, first, lm_params(solver));
    const gtsam::Values values = optimiser.optimize();
    result.converged = optimiser.iterations() < static_cast<std::size_t>(config.max_iterations);
    if (!result.converged) result.reason = "iteration limit";
    for (std::size_t k = 0; k < result.enu_from_keyframe.size(); ++k)
      result.enu_from_keyframe[k] = from_gtsam(values.at<gtsam::Pose3>(k));
    const gtsam::Marginals marginals(graph, values);
    result.first_covariance = marginals.marginalCovariance(0);
    result.last_covariance = marginals.marginalCovariance(result.enu_from_keyframe.size() - 1);
    result.expected_error_m = expected_error_m(marginals, result.enu_from_keyframe.size());
    result.log_evidence = log_evidence(graph, values);
    fusion.judge(values, result);
  } catch (const std::exception& error) {  // an indeterminate system
    result.converged = false;
    result.reason = error.what();
    for (std::size_t k = 0; k < result.enu_from_keyframe.size(); ++k)
      result.enu_from_keyframe[k] = enu_from_world * problem.world_from_keyframe[k];
  }
  return result;
}

}  // namespace understory
