#pragma once

#include <Eigen/Cholesky>
#include <cstddef>
#include <vector>

#include "understory/odometry/imu/preintegration.h"

namespace understory {

using Matrix15x2 = Eigen::Matrix<double, 15, 2>;

// Solves for one state: A x = b with a symmetric A (LDLT with pivoting). Eigen's templates for
// fifteen numbers are compiled once here.
class StateSolver {
 public:
  // All of `matrix` is finite; only its lower triangle is read.
  explicit StateSolver(const Matrix15d& matrix);

  [[nodiscard]] Vector15d solve(const Vector15d& right) const;
  [[nodiscard]] Matrix15d solve(const Matrix15d& right) const;
  [[nodiscard]] Matrix15x2 solve(const Matrix15x2& right) const;
  [[nodiscard]] Matrix15d inverse() const;

 private:
  Eigen::LDLT<Matrix15d> factor_;
};

// The residual of a motion and its derivatives in standard deviations (L^-1 of each, with L L^T the
// covariance). So products of them are symmetric to the last bit.
struct WhiteMotion {
  Eigen::Matrix<double, 9, 15> by_from;
  Eigen::Matrix<double, 9, 15> by_to;
  Eigen::Matrix<double, 9, 2> by_tilt;
  Vector9d error;
};

// Normal equations of consecutive states that the IMU ties to each other: block tridiagonal.
struct ChainEquations {
  explicit ChainEquations(std::size_t states);

  std::vector<Matrix15d> diagonal;
  std::vector<Matrix15d> next;  // block (k, k + 1)
  std::vector<Vector15d> right;

  // Adds what the IMU measured between the states k and k + 1, and the random walk of its biases.
  // `gravity_by_tilt`: derivative of the gravity vector by two tilts, zero where it is known.
  // Returns what was added, whitened.
  WhiteMotion add_motion(std::size_t k, const ImuState& from, const ImuState& to,
                         const Preintegration& motion, const Eigen::Vector3d& gravity,
                         const Eigen::Matrix<double, 3, 2>& gravity_by_tilt,
                         const ImuNoiseConfig& noise);

  // Takes state k out of the equations, on to k + 1. Returns the solver of its diagonal block.
  StateSolver eliminate(std::size_t k);
};

}  // namespace understory
