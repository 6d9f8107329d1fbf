#include "understory/registration/range_offset/range_offset.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/registration/registration_constants.h"

namespace understory {

void describe(ConfigTable& table, RangeOffsetConfig& config) {
  describe(table, config.view);
  table.add("kernel_m", config.kernel_m, {0.001, 10.0}, "m",
            "scale of the Geman-McClure kernel at the end");
  table.add("max_distance_m", config.max_distance_m, {0.01, 20.0}, "m",
            "largest distance between the middles of two matched patches");
  table.add("max_angle_deg", config.max_angle_deg, {0.1, 90.0}, "deg",
            "largest angle between the normals of two matched patches");
  table.add("min_matches", config.min_matches, {7, 1000000}, "",
            "with fewer matched patches a pair of views is not used");
  table.add("iterations", config.iterations, {1, 1000}, "", "steps for one pair of views");
  table.add("guess_translation_m", config.guess_translation_m, {1e-3, 100.0}, "m",
            "standard deviation of the known shift between two views");
  table.add("guess_rotation_deg", config.guess_rotation_deg, {1e-3, 180.0}, "deg",
            "standard deviation of the known turn between two views");
}

namespace {

using namespace registration_constants::range_offset;

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

struct Sums {
  Matrix7d information = Matrix7d::Zero();
  Vector7d gradient = Vector7d::Zero();
  double weight = 0.0;
  double weighted_squares = 0.0;
  int matches = 0;
};

class Solver {
 public:
  Solver(const SurfaceView& target, const SurfaceView& source, const Eigen::Vector3d& lidar_in_body,
         const Pose& guess, const RangeOffsetConfig& config)
      : target_(target),
        source_(source),
        lidar_(lidar_in_body),
        guess_(guess),
        config_(config),
        min_cosine_(std::cos(config.max_angle_deg * std::numbers::pi / 180.0)) {}

  RangeOffset solve() {
    pose_ = guess_;
    Sums sums;
    for (int i = 0; i < config_.iterations; ++i) {
      const double progress =
          std::min(1.0, 1.5 * static_cast<double>(i) / static_cast<double>(config_.iterations));
      sums = gather(config_.kernel_m * std::pow(kWidest, 1.0 - progress));
      if (sums.matches < config_.min_matches) return {};
      Vector7d step = -sums.information.ldlt().solve(sums.gradient);
      step *= std::min(1.0, kLongestStep / std::max(1e-9, step.cwiseAbs().maxCoeff()));
      pose_ = pose_ * Pose::exp(step.head<6>());
      offset_ += step[6];
    }
    RangeOffset result;
    result.solved = true;
    result.offset_m = offset_;
    result.matches = sums.matches;
    result.target_from_source = pose_;
    // Residuals larger than the noise that was assumed make the estimate worse.
    const double noise = std::sqrt(sums.weighted_squares / std::max(1e-9, sums.weight));
    const Matrix7d covariance = sums.information.ldlt().solve(Matrix7d::Identity());
    result.sd_m = std::sqrt(covariance(6, 6)) * std::max(1.0, noise / kPatchNoise);
    return result;
  }

 private:
  // Normal equations at the present estimate.
  Sums gather(double kernel_m) const {
    Sums sums;
    const Eigen::Matrix3d rotation = pose_.rotation_matrix();
    for (const FlatPatch& patch : source_.patches()) {
      const Eigen::Vector3d corrected = patch.mean - offset_ * patch.ray;
      const Eigen::Vector3d placed = pose_ * corrected;
      // Where the target's lidar would have measured it, with its wrong ranges.
      const Eigen::Vector3d seen = placed + offset_ * (placed - lidar_).normalized();
      const FlatPatch* match = target_.nearest(seen);
      if (match == nullptr) continue;
      if ((match->mean - seen).squaredNorm() > config_.max_distance_m * config_.max_distance_m)
        continue;
      const Eigen::Vector3d turned = rotation * patch.normal;
      if (turned.dot(match->normal) < min_cosine_) continue;
      const Eigen::Vector3d normal = (turned + match->normal).normalized();
      const double residual = normal.dot(placed - (match->mean - offset_ * match->ray));
      const Eigen::Vector3d in_source = rotation.transpose() * normal;
      Vector7d row;
      row << corrected.cross(in_source), in_source,
          normal.dot(match->ray) - in_source.dot(patch.ray);
      add(row, residual, kernel_m, sums);
    }
    add_beliefs(sums);
    return sums;
  }

  static void add(const Vector7d& row, double residual, double kernel_m, Sums& sums) {
    const double share = kernel_m * kernel_m / (kernel_m * kernel_m + residual * residual);
    const double weight = share * share;
    const double precision = weight / (kPatchNoise * kPatchNoise);
    sums.information += precision * row * row.transpose();
    sums.gradient += precision * residual * row;
    sums.weight += weight;
    sums.weighted_squares += weight * residual * residual;
    ++sums.matches;
  }

  void add_beliefs(Sums& sums) const {
    const double turn = config_.guess_rotation_deg * std::numbers::pi / 180.0;
    Vector7d precision;
    precision << Eigen::Vector3d::Constant(1.0 / (turn * turn)),
        Eigen::Vector3d::Constant(1.0 /
                                  (config_.guess_translation_m * config_.guess_translation_m)),
        1.0 / (kOffsetSd * kOffsetSd);
    Vector7d away;
    away << right_difference(pose_, guess_), offset_;
    sums.information += precision.asDiagonal();
    sums.gradient += precision.cwiseProduct(away);
  }

  const SurfaceView& target_;
  const SurfaceView& source_;
  Eigen::Vector3d lidar_;
  Pose guess_;
  const RangeOffsetConfig& config_;
  double min_cosine_;
  Pose pose_;
  double offset_ = 0.0;
};

}  // namespace

RangeOffset solve_range_offset(const SurfaceView& target, const SurfaceView& source,
                               const Eigen::Vector3d& lidar_in_body, const Pose& target_from_source,
                               const RangeOffsetConfig& config) {
  return Solver(target, source, lidar_in_body, target_from_source, config).solve();
}

}  // namespace understory
