#include "understory/forest/stems/bark_brightness.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "understory/util/random.h"

namespace understory {
namespace {

const BeamConfig kVlp{LidarSensor::kVlp16, 0.0, 0.0, 0.0};

// How a stem comes out from a range, with bark so many times as bright.
StemLook look(double radius_m, double range_m, double times) {
  const BeamFootprint beam = brightened(footprint_at(kVlp, range_m), times);
  double shown = radius_m;
  for (int i = 0; i < 15; ++i)
    shown = radius_m + excess_radius_m(beam, shown, 180.0);
  return {range_m, shown, 180.0, 0.001};
}

std::vector<StemSeenTwice> stand(std::size_t stems, double times, double noise_m = 0.003) {
  Random random(7);
  std::vector<StemSeenTwice> seen;
  for (std::size_t i = 0; i < stems; ++i) {
    const double radius = random.uniform(0.09, 0.18);
    StemLook far = look(radius, random.uniform(25.0, 50.0), times);
    far.radius_m += random.normal(0.0, noise_m);
    seen.push_back({i, look(radius, 7.0, times), far});
  }
  return seen;
}

TEST(BarkBrightness, StemsSeenFromNearAndFromAfarTellIt) {
  double last = 0.0;
  for (const double times : {0.5, 1.0, 2.0, 4.0}) {
    const BarkBrightness bark = learn_brightness(kVlp, stand(40, times));
    EXPECT_TRUE(bark.learnt);
    EXPECT_EQ(bark.stems, 40);
    EXPECT_NEAR(std::log(bark.times), std::log(times), 0.35) << times;
    EXPECT_GT(bark.times, last);
    last = bark.times;
    EXPECT_NEAR(std::accumulate(bark.chances.begin(), bark.chances.end(), 0.0), 1.0, 1e-9);
  }
}

TEST(BarkBrightness, AStemThatIsQuiteWrongChangesLittle) {
  std::vector<StemSeenTwice> seen = stand(30, 1.0);
  const double before = learn_brightness(kVlp, seen).times;
  seen[4].far.radius_m += 0.3;
  EXPECT_NEAR(std::log(learn_brightness(kVlp, seen).times), std::log(before), 0.1);
}

TEST(BarkBrightness, NothingIsLearntFromFewStemsOrOfUnknownBeams) {
  EXPECT_TRUE(learn_brightness(kVlp, stand(8, 4.0)).learnt);
  const BarkBrightness few = learn_brightness(kVlp, stand(7, 4.0));
  EXPECT_FALSE(few.learnt);
  EXPECT_EQ(few.stems, 7);
  EXPECT_EQ(few.times, 1.0);
  EXPECT_EQ(excess_sd_m(few, footprint_at(kVlp, 30.0), 0.12, 180.0), 0.0);
  const BarkBrightness unknown = learn_brightness({}, stand(40, 4.0));
  EXPECT_FALSE(unknown.learnt);
  EXPECT_EQ(unknown.times, 1.0);
  // Many looks at seven stems are seven stems.
  std::vector<StemSeenTwice> again = stand(40, 4.0);
  for (StemSeenTwice& pair : again)
    pair.stem %= 7;
  EXPECT_FALSE(learn_brightness(kVlp, again).learnt);
}

TEST(BarkBrightness, IsSurerByMoreStemsButNeverQuiteSure) {
  const auto log_sd = [&](std::size_t stems, double noise_m) {
    const BarkBrightness bark = learn_brightness(kVlp, stand(stems, 1.0, noise_m));
    const auto multiples = BarkBrightness::multiples();
    double square = 0.0;
    for (std::size_t k = 0; k < multiples.size(); ++k)
      square += bark.chances[k] * std::pow(std::log(multiples[k] / bark.times), 2);
    return std::sqrt(square);
  };
  EXPECT_LT(log_sd(150, 0.015), 0.8 * log_sd(8, 0.015));
  EXPECT_LT(log_sd(10, 0.003), 0.8 * log_sd(10, 0.03)) << "stems show how much they scatter";
  EXPECT_GT(log_sd(150, 0.0), 0.15) << "what all pairs share stays";
  const BarkBrightness bark = learn_brightness(kVlp, stand(20, 1.0));
  const double near = excess_sd_m(bark, footprint_at(kVlp, 5.0), 0.12, 180.0);
  EXPECT_LT(near, 0.1 * excess_sd_m(bark, footprint_at(kVlp, 45.0), 0.12, 180.0));
}

TEST(BarkBrightness, BrightBarkMakesFarStemsThicker) {
  const BeamFootprint beam = footprint_at(kVlp, 45.0);
  EXPECT_GT(excess_radius_m(brightened(beam, 4.0), 0.12, 180.0),
            excess_radius_m(beam, 0.12, 180.0) + 0.003);
  EXPECT_EQ(brightened(beam, 4.0).sd_m, beam.sd_m);
}

}  // namespace
}  // namespace understory
