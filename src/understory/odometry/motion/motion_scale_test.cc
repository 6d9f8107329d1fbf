#include "understory/odometry/motion/motion_scale.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

const Eigen::Vector3d kUp(0.0, 0.0, 9.81);
const MotionScale::Drive kStill{0.1 * kUp, 0.005 * kUp};  // a tenth of a second

// A walk that swings: x = sin(1.5 t), y = 0.5 cos(2 t), seen by an accelerometer and, `scale` times
// as large, by a lidar at 10 Hz.
MotionScale watch(double scale, double seconds, double faster = 1.0) {
  MotionScale motion;
  constexpr double kStepS = 0.1;
  const auto place = [&](double t) {
    return Eigen::Vector3d(std::sin(1.5 * faster * t), 0.5 * std::cos(2.0 * faster * t), 0.0);
  };
  const auto speed = [&](double t) {
    return Eigen::Vector3d(1.5 * faster * std::cos(1.5 * faster * t),
                           -faster * std::sin(2.0 * faster * t), 0.0);
  };
  for (double t = 0.0; t < seconds; t += kStepS) {
    const Eigen::Vector3d step = place(t + kStepS) - place(t);
    const MotionScale::Drive drive{speed(t + kStepS) - speed(t) + kStepS * kUp,
                                   step - kStepS * speed(t) + 0.5 * kStepS * kStepS * kUp};
    motion.add(scale * step, drive, kStepS);
  }
  return motion;
}

TEST(MotionScale, IsOneWhereBothAgreeAndTellsFeetFromMetres) {
  EXPECT_NEAR(watch(1.0, 30.0).scale(), 1.0, 0.01);
  EXPECT_NEAR(watch(1.0, 30.0).correlation(), 1.0, 0.01);
  EXPECT_NEAR(watch(3.28, 30.0).scale(), 3.28, 0.03);
  EXPECT_NEAR(watch(-1.0, 30.0).correlation(), -1.0, 0.01);
}

// A regression: at a walker's pace the scale came out up to a tenth too large.
TEST(MotionScale, IsOneForTheSwingOfAStepToo) {
  EXPECT_NEAR(watch(1.0, 30.0, 6.0).scale(), 1.0, 0.002);  // 1.4 Hz and 1.9 Hz
}

TEST(MotionScale, KnowsHowMuchItHasSeen) {
  EXPECT_EQ(MotionScale().windows(), 0);
  EXPECT_EQ(MotionScale().scale(), 0.0);
  MotionScale still;
  for (int i = 0; i < 100; ++i)
    still.add(Eigen::Vector3d::Zero(), kStill, 0.1);
  EXPECT_NEAR(still.spread_m_s2(), 0.0, 1e-6);
  EXPECT_GT(watch(1.0, 30.0).spread_m_s2(), 1.0);
}

TEST(MotionScale, AnInterruptionComparesNothingAcrossIt) {
  MotionScale motion = watch(1.0, 3.05);
  const int before = motion.windows();
  motion.interrupt();
  for (int i = 0; i < 3; ++i)
    motion.add({1.0, 0.0, 0.0}, kStill, 0.1);
  EXPECT_EQ(motion.windows(), before);
}

TEST(MotionScale, GoesOnFromWhatWasSaved) {
  MotionScale motion = watch(1.3, 10.0);
  BinaryWriter writer;
  motion.save(writer);
  const std::string bytes = writer.bytes();
  BinaryReader reader(bytes, "test");
  MotionScale again;
  again.load(reader);
  const MotionScale::Drive drive{0.4 * kUp, 0.08 * kUp};
  motion.add({0.1, 0.0, 0.0}, drive, 0.4);
  again.add({0.1, 0.0, 0.0}, drive, 0.4);
  EXPECT_EQ(motion.scale(), again.scale());
  EXPECT_EQ(motion.windows(), again.windows());
}

}  // namespace
}  // namespace understory
