#include "understory/odometry/imu/chain_equations.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <vector>

namespace understory {
namespace {

// Two seconds of a carrier that turns and speeds up, in two intervals of equal length.
std::vector<Preintegration> two_motions() {
  std::vector<Preintegration> motions;
  for (int part = 0; part < 2; ++part) {
    std::vector<InertialSample> samples(101);
    for (int k = 0; k <= 100; ++k) {
      InertialSample& sample = samples[static_cast<std::size_t>(k)];
      sample.stamp = (100 * part + k) * kNsPerSecond / 100;
      sample.gyro[2] = 0.2;
      sample.accel[0] = 0.3;
      sample.accel[2] = 9.81;
    }
    motions.push_back(
        preintegrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), ImuNoiseConfig()));
  }
  return motions;
}

// States that are a little off.
std::vector<ImuState> three_states() {
  std::vector<ImuState> states(3);
  for (int k = 0; k < 3; ++k) {
    Vector15d off = Vector15d::Zero();
    off.segment<3>(3) << 0.1 * k, -0.02, 0.03 * k;
    off(8) = 0.05 * k;
    states[static_cast<std::size_t>(k)] = retract(ImuState(), off);
  }
  return states;
}

TEST(ChainEquations, EliminationGivesWhatTheWholeMatrixGives) {
  const std::vector<Preintegration> motions = two_motions();
  const std::vector<ImuState> states = three_states();
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  const Eigen::Matrix<double, 3, 2> known = Eigen::Matrix<double, 3, 2>::Zero();
  ChainEquations chain(3);
  // A prior, or all could move together.
  chain.diagonal[0].diagonal().setConstant(100.0);
  chain.right[0].setConstant(0.5);
  for (std::size_t k = 0; k < 2; ++k)
    chain.add_motion(k, states[k], states[k + 1], motions[k], gravity, known, ImuNoiseConfig());

  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(45, 45);
  Eigen::VectorXd right(45);
  for (int k = 0; k < 3; ++k) {
    const auto at = static_cast<std::size_t>(k);
    whole.block<15, 15>(15 * k, 15 * k) = chain.diagonal[at];
    right.segment<15>(15 * k) = chain.right[at];
    if (k == 2) continue;
    whole.block<15, 15>(15 * k, 15 * k + 15) = chain.next[at];
    whole.block<15, 15>(15 * k + 15, 15 * k) = chain.next[at].transpose();
  }
  const Eigen::VectorXd expected = whole.ldlt().solve(right);

  chain.eliminate(0);
  chain.eliminate(1);
  const Vector15d last = StateSolver(chain.diagonal[2]).solve(chain.right[2]);
  EXPECT_LT((last - expected.tail<15>()).norm(), 1e-6 * expected.norm());
  const Vector15d middle =
      StateSolver(chain.diagonal[1]).solve(Vector15d(chain.right[1] - chain.next[1] * last));
  EXPECT_LT((middle - expected.segment<15>(15)).norm(), 1e-6 * expected.norm());
}

TEST(ChainEquations, AMotionThatFitsPullsNothing) {
  const std::vector<Preintegration> motions = two_motions();
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  const ImuState from;
  const ImuState to = predict_state(from, motions[0], kNsPerSecond, gravity);
  ChainEquations chain(2);
  const WhiteMotion white = chain.add_motion(0, from, to, motions[0], gravity,
                                             Eigen::Matrix<double, 3, 2>::Zero(), ImuNoiseConfig());
  EXPECT_LT(white.error.norm(), 1e-6);
  EXPECT_LT(chain.right[0].norm(), 1e-6 * chain.diagonal[0].norm());
  EXPECT_EQ(white.by_tilt.norm(), 0.0);
  EXPECT_LT((chain.diagonal[1] - chain.diagonal[1].transpose()).norm(), 1e-300) << "symmetric";
}

}  // namespace
}  // namespace understory
