#include "understory/calibration/imu_noise/allan_deviation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

std::vector<double> noisy_signal(std::size_t count) {
  Random random(7, 0);
  std::vector<double> values;
  double walk = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    walk += 0.1 * random.normal();
    values.push_back(1000.0 + walk + random.normal());
  }
  return values;
}

// The definition, window by window.
double deviation_of(const std::vector<double>& values, std::size_t width, std::size_t step) {
  double squares = 0.0;
  double pairs = 0.0;
  for (std::size_t from = 0; from + 2 * width <= values.size(); from += step) {
    double earlier = 0.0;
    double later = 0.0;
    for (std::size_t i = 0; i < width; ++i) {
      earlier += values[from + i];
      later += values[from + width + i];
    }
    squares += std::pow((later - earlier) / static_cast<double>(width), 2.0);
    ++pairs;
  }
  return std::sqrt(0.5 * squares / pairs);
}

TEST(AllanDeviation, IsTheDefinitionWithOverlappingWindows) {
  const std::vector<double> values = noisy_signal(1500);
  AllanDeviation allan;
  for (const double value : values)
    allan.add(value);
  const std::vector<AllanPoint> curve = allan.curve(0.005);
  ASSERT_EQ(curve.size(), 9U);  // 256 samples three times are fewer than 1500, 512 are not
  std::size_t width = 1;
  for (const AllanPoint& point : curve) {
    EXPECT_DOUBLE_EQ(point.time_s, 0.005 * static_cast<double>(width));
    EXPECT_NEAR(point.deviation, deviation_of(values, width, std::max<std::size_t>(1, width / 8)),
                1e-9 * point.deviation)
        << width;
    width *= 2;
  }
  EXPECT_EQ(curve[0].pairs, 1499U);
  EXPECT_EQ(curve[3].pairs, 1485U);
}

TEST(AllanDeviation, OfAStraightRampIsItsSlopeTimesTheTimeOverRoot2) {
  AllanDeviation allan;
  for (int i = 0; i < 1000; ++i)
    allan.add(0.25 * i);
  for (const AllanPoint& point : allan.curve(1.0))
    EXPECT_NEAR(point.deviation, 0.25 * point.time_s / std::sqrt(2.0), 1e-9);
}

TEST(AllanDeviation, ShortSignalsHaveNoCurve) {
  AllanDeviation allan;
  EXPECT_TRUE(allan.curve(1.0).empty());
  allan.add(1.0);
  allan.add(2.0);
  EXPECT_TRUE(allan.curve(1.0).empty());
  allan.add(1.0);
  EXPECT_EQ(allan.curve(1.0).size(), 1U);
}

}  // namespace
}  // namespace understory
