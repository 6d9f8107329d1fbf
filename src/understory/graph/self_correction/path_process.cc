#include "understory/graph/self_correction/path_process.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "understory/graph/graph_constants.h"
#include "understory/util/error.h"
#include "understory/util/index.h"

namespace understory {
namespace {

using namespace graph_constants::path_process;

// A motion of the world seen at a place: its rotation vector and by what it moves the place.
Vector6d seen_at(const Pose& motion, const Eigen::Vector3d& place) {
  Vector6d result;
  result << so3_log(motion.rotation()), motion * place - place;
  return result;
}

// Turns about a place and then shifts.
Pose motion_at(const Vector6d& twist, const Eigen::Vector3d& place) {
  const Eigen::Quaterniond turn = so3_exp(twist.head<3>());
  return {turn, place + twist.tail<3>() - turn * place};
}

// Rows of a covariance that tell of the plane: yaw and the two shifts.
constexpr std::array<int, 3> kPlaneRows = {2, 3, 4};

using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

// exp(-|m - l| / length) applied along the rows, in one pass each way.
Columns correlated(const Columns& values, double length_views) {
  if (length_views <= 0.0) return values;
  const double share = std::exp(-1.0 / length_views);
  Columns left = values;
  Columns right = values;
  for (Eigen::Index m = 1; m < values.rows(); ++m)
    left.row(m) += share * left.row(m - 1);
  for (Eigen::Index m = values.rows() - 2; m >= 0; --m)
    right.row(m) += share * right.row(m + 1);
  return left + right - values;
}

class PathProcess {
 public:
  PathProcess(const std::vector<Pose>& poses, const Vector6d& variances,
              const std::vector<PathObservation>& observations)
      : poses_(poses), variances_(variances), observations_(observations) {
    for (const PathObservation& seen : observations) {
      const Pose& i = poses[at(seen.i)];
      observed_.push_back(
          seen_at(poses[at(seen.j)] * seen.j_from_i * i.inverse(), i.translation()));
      const Eigen::Matrix3d turn = i.rotation().toRotationMatrix();
      Matrix6d axes = Matrix6d::Zero();
      axes.topLeftCorner<3, 3>() = turn;
      axes.bottomRightCorner<3, 3>() = turn;
      noise_.push_back(axes * seen.covariance * axes.transpose());
    }
    rates_ = Columns::Zero(static_cast<Eigen::Index>(poses.size()), 6);
  }

  // Sums over the steps of every two observations, of 1 and of the place of the step as seen from
  // the observation's later view. Covariances need no more, whatever the scale is.
  void set_length(double length_views) {
    length_views_ = length_views;
    sums_.assign(observations_.size(), {});
    for (std::size_t b = 0; b < observations_.size(); ++b) {
      const Columns spread = correlated(steps_of(b), length_views);
      for (std::size_t a = 0; a <= b; ++a) {
        const PathObservation& seen = observations_[a];
        const Columns own = steps_of(a).middleRows(seen.j + 1, seen.i - seen.j);
        sums_[b].emplace_back(own.transpose() * spread.middleRows(seen.j + 1, seen.i - seen.j));
      }
    }
  }

  void set_scale(double scale) {
    scaled_ = variances_;
    for (const int row : kPlaneRows)
      scaled_[row] *= scale * scale;
  }

  // Of the observations in `rows`, ascending, with their noise.
  [[nodiscard]] Eigen::MatrixXd covariance(const std::vector<std::size_t>& rows) const {
    const auto n = static_cast<Eigen::Index>(rows.size());
    Eigen::MatrixXd result(6 * n, 6 * n);
    for (Eigen::Index b = 0; b < n; ++b) {
      for (Eigen::Index a = 0; a <= b; ++a) {
        const std::size_t earlier = rows[static_cast<std::size_t>(a)];  // rows ascend
        const std::size_t later = rows[static_cast<std::size_t>(b)];
        Matrix6d block = shared(sums_[later][earlier]);
        if (a == b) block += noise_[later];
        result.block<6, 6>(6 * a, 6 * b) = block;
        result.block<6, 6>(6 * b, 6 * a) = block.transpose();
      }
    }
    return result;
  }

  [[nodiscard]] Eigen::VectorXd observed(const std::vector<std::size_t>& rows) const {
    Eigen::VectorXd result(6 * static_cast<Eigen::Index>(rows.size()));
    for (std::size_t k = 0; k < rows.size(); ++k)
      result.segment<6>(6 * static_cast<Eigen::Index>(k)) = observed_[rows[k]];
    return result;
  }

  // Posterior mean. Twice again from where it led, as turns do not just add up.
  void solve(const std::vector<std::size_t>& rows) {
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance(rows));
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
      const std::vector<Pose> corrections = added_up();
      Eigen::VectorXd target(6 * static_cast<Eigen::Index>(rows.size()));
      for (std::size_t k = 0; k < rows.size(); ++k) {
        const PathObservation& seen = observations_[rows[k]];
        const Pose between = corrections[at(seen.j)].inverse() * corrections[at(seen.i)];
        target.segment<6>(6 * static_cast<Eigen::Index>(k)) =
            observed_[rows[k]] - seen_at(between, poses_[at(seen.i)].translation()) + summed(seen);
      }
      const Eigen::VectorXd weights = factor.solve(target);
      Columns pulls = Columns::Zero(rates_.rows(), 6);
      for (std::size_t k = 0; k < rows.size(); ++k)
        pull(observations_[rows[k]], weights.segment<6>(6 * static_cast<Eigen::Index>(k)), pulls);
      rates_ = correlated(pulls, length_views_) * scaled_.asDiagonal();
    }
  }

  // What every view is moved by.
  [[nodiscard]] std::vector<Pose> added_up() const {
    std::vector<Pose> result(1);
    for (std::size_t m = 1; m < poses_.size(); ++m)
      result.push_back(
          result.back() *
          motion_at(rates_.row(static_cast<Eigen::Index>(m)).transpose(), poses_[m].translation()));
    return result;
  }

 private:
  // How a turn and shift at step m show at the observation's later view: rows of A.
  [[nodiscard]] Eigen::Vector3d arm(const PathObservation& seen, int m) const {
    return poses_[at(m)].translation() - poses_[at(seen.i)].translation();
  }

  [[nodiscard]] Columns steps_of(std::size_t a) const {
    const PathObservation& seen = observations_[a];
    Columns result = Columns::Zero(static_cast<Eigen::Index>(poses_.size()), 4);
    for (int m = seen.j + 1; m <= seen.i; ++m) {
      result(m, 0) = 1.0;
      result.block<1, 3>(m, 1) = arm(seen, m).transpose();
    }
    return result;
  }

  // A D A^T summed over both observations' steps; A is linear in 1 and the place.
  [[nodiscard]] Matrix6d shared(const Eigen::Matrix4d& sums) const {
    const Eigen::Matrix3d turn = scaled_.head<3>().asDiagonal();
    const Eigen::Matrix3d shift = scaled_.tail<3>().asDiagonal();
    Matrix6d result = Matrix6d::Zero();
    result.topLeftCorner<3, 3>() = sums(0, 0) * turn;
    result.bottomRightCorner<3, 3>() = sums(0, 0) * shift;
    for (int c = 0; c < 3; ++c) {
      const Eigen::Matrix3d s = skew(Eigen::Vector3d::Unit(c));
      result.topRightCorner<3, 3>() += sums(0, c + 1) * turn * s.transpose();
      result.bottomLeftCorner<3, 3>() += sums(c + 1, 0) * s * turn;
      for (int d = 0; d < 3; ++d)
        result.bottomRightCorner<3, 3>() +=
            sums(c + 1, d + 1) * s * turn * skew(Eigen::Vector3d::Unit(d)).transpose();
    }
    return result;
  }

  // A^T of an observation's weight, added to the steps that it is made of.
  void pull(const PathObservation& seen, const Vector6d& weight, Columns& pulls) const {
    for (int m = seen.j + 1; m <= seen.i; ++m) {
      pulls.row(m).head<3>() +=
          (weight.head<3>() + skew(arm(seen, m)).transpose() * weight.tail<3>()).transpose();
      pulls.row(m).tail<3>() += weight.tail<3>().transpose();
    }
  }

  [[nodiscard]] Vector6d summed(const PathObservation& seen) const {
    Vector6d result = Vector6d::Zero();
    for (int m = seen.j + 1; m <= seen.i; ++m) {
      const Vector6d rate = rates_.row(m).transpose();
      result.head<3>() += rate.head<3>();
      result.tail<3>() += rate.tail<3>() + skew(arm(seen, m)) * rate.head<3>();
    }
    return result;
  }

  const std::vector<Pose>& poses_;
  Vector6d variances_;
  Vector6d scaled_ = Vector6d::Ones();
  const std::vector<PathObservation>& observations_;
  std::vector<Vector6d> observed_;
  std::vector<Matrix6d> noise_;
  std::vector<std::vector<Eigen::Matrix4d>> sums_;  // [b][a], a <= b: of a (rows) and b
  double length_views_ = 0.0;
  Columns rates_;  // a row per view: of the step that leads to it
};

// The rows of yaw and plane.
Eigen::MatrixXd plane_of(const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = covariance.rows() / 6;
  Eigen::MatrixXd result(3 * n, 3 * n);
  for (Eigen::Index b = 0; b < 3 * n; ++b) {
    for (Eigen::Index a = 0; a < 3 * n; ++a)
      result(a, b) = covariance(6 * (a / 3) + kPlaneRows[static_cast<std::size_t>(a % 3)],
                                6 * (b / 3) + kPlaneRows[static_cast<std::size_t>(b % 3)]);
  }
  return result;
}

Eigen::VectorXd plane_of_vector(const Eigen::VectorXd& values) {
  const Eigen::Index n = values.size() / 6;
  Eigen::VectorXd result(3 * n);
  for (Eigen::Index a = 0; a < 3 * n; ++a)
    result[a] = values[6 * (a / 3) + kPlaneRows[static_cast<std::size_t>(a % 3)]];
  return result;
}

struct Fit {
  double length_views = 0.0;
  double scale = 1.0;
  double likelihood = -std::numeric_limits<double>::infinity();
};

// Length and scale of the largest marginal likelihood of the observations in yaw and plane.
Fit most_likely(PathProcess& process, std::vector<std::size_t> rows,
                const PathProcessConfig& config) {
  if (rows.size() > kEnough) {
    std::vector<std::size_t> some;
    for (std::size_t k = 0; k < kEnough; ++k)
      some.push_back(rows[k * rows.size() / kEnough]);
    rows = some;
  }
  std::vector<double> lengths(std::begin(kLengths), std::end(kLengths));
  if (config.length_views >= 0.0) lengths = {config.length_views};
  const Eigen::VectorXd seen = plane_of_vector(process.observed(rows));
  Fit best;
  for (const double length : lengths) {
    process.set_length(length);
    for (int half = kLeastHalfPowers; half <= kMostHalfPowers; ++half) {
      const double scale = std::pow(2.0, 0.5 * half);
      process.set_scale(scale);
      const Eigen::LLT<Eigen::MatrixXd> factor(plane_of(process.covariance(rows)));
      if (factor.info() != Eigen::Success) continue;
      const double likelihood = -0.5 * seen.dot(factor.solve(seen)) -
                                Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
      if (likelihood > best.likelihood) best = {length, scale, likelihood};
    }
  }
  process.set_length(best.length_views);
  process.set_scale(best.scale);
  return best;
}

// The observation that the others contradict most, and by how much (chi squared, 3 degrees).
std::pair<std::size_t, double> max_contradicted(const PathProcess& process,
                                                const std::vector<std::size_t>& rows) {
  const Eigen::MatrixXd covariance = plane_of(process.covariance(rows));
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::MatrixXd inverse =
      factor.solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
  const Eigen::VectorXd weighted = inverse * plane_of_vector(process.observed(rows));
  std::pair<std::size_t, double> worst{0, 0.0};
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto row = 3 * static_cast<Eigen::Index>(k);
    const Eigen::Vector3d own = weighted.segment<3>(row);
    // Left out: the residual is own block^-1 times the weighted value, its covariance block^-1.
    const double chi2 = own.dot(inverse.block<3, 3>(row, row).inverse() * own);
    if (chi2 > worst.second) worst = {k, chi2};
  }
  return worst;
}

}  // namespace

PathProcessResult regress_path(const std::vector<Pose>& world_from_view,
                               const Vector6d& step_variances,
                               const std::vector<PathObservation>& observations,
                               const PathProcessConfig& config) {
  UNDERSTORY_CHECK((step_variances.array() > 0.0).all());
  for (const PathObservation& seen : observations)
    UNDERSTORY_CHECK(0 <= seen.j && seen.j < seen.i && at(seen.i) < world_from_view.size());
  PathProcessResult result;
  result.world_from_view = world_from_view;
  result.used.assign(observations.size(), 1);
  if (observations.empty()) return result;
  PathProcess process(world_from_view, step_variances, observations);
  std::vector<std::size_t> rows(observations.size());
  for (std::size_t k = 0; k < rows.size(); ++k)
    rows[k] = k;
  Fit fit = most_likely(process, rows, config);
  const std::size_t fewest = (rows.size() + 1) / 2;
  while (rows.size() > fewest) {
    const auto [worst, chi2] = max_contradicted(process, rows);
    if (chi2 <= config.largest_chi2) break;
    result.used[rows[worst]] = 0;
    rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(worst));
    // A wrong observation makes all others look noisy: what is left is asked again.
    fit = most_likely(process, rows, config);
  }
  result.length_views = fit.length_views;
  result.scale = fit.scale;
  process.solve(rows);
  const std::vector<Pose> corrections = process.added_up();
  for (std::size_t k = 0; k < corrections.size(); ++k)
    result.world_from_view[k] = corrections[k] * world_from_view[k];
  return result;
}

}  // namespace understory
