#include "understory/forest/stems/beam_footprint.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

TEST(BeamFootprint, WidthGrowsWithTheRangeAndIsNothingWithoutASensorOrARange) {
  const BeamConfig os1{LidarSensor::kOs1, 0.0, 0.0, 0.0};
  // 9.5 mm at the sensor and 3 mrad: 39.5 mm at 10 m, four standard deviations.
  EXPECT_NEAR(footprint_at(os1, 10.0).sd_m, 0.0395 / 4.0, 1e-12);
  EXPECT_NEAR(footprint_at(os1, 10.0).signal, 4.0 * footprint_at(os1, 20.0).signal, 1e-9);
  EXPECT_EQ(footprint_at(os1, 0.0).sd_m, 0.0);
  EXPECT_EQ(footprint_at({}, 10.0).sd_m, 0.0);
  BeamConfig own = os1;
  own.divergence_mrad = 6.0;
  EXPECT_NEAR(footprint_at(own, 10.0).sd_m, 0.0695 / 4.0, 1e-12);
}

TEST(BeamFootprint, ARecordingNamesItsLidar) {
  EXPECT_EQ(sensor_of_model("OS-0-128"), LidarSensor::kOs0);
  EXPECT_EQ(sensor_of_model("OS0-32"), LidarSensor::kOs0);
  EXPECT_EQ(sensor_of_model("OS-1-64"), LidarSensor::kOs1);
  EXPECT_EQ(sensor_of_model("VLP-16"), LidarSensor::kVlp16);
  EXPECT_EQ(sensor_of_model("VLP-32C"), LidarSensor::kVlp32);
  // Their beams are others, or are not known.
  for (const char* other :
       {"", "OS", "OS-0", "OS-2-128", "OS-0-128, single rays", "RS-16", "Mid-360", "VLP-16 Hi-Res"})
    EXPECT_EQ(sensor_of_model(other), LidarSensor::kUnknown) << other;
}

TEST(BeamFootprint, RangesCountByTheReturnsThatTheyGive) {
  // Four times as many returns from 5 m as from 10 m.
  const std::vector<Eigen::Vector3d> scanner = {{4.0, 0.0, 3.0}, {0.0, 8.0, 6.0}};
  EXPECT_NEAR(mean_range_to(scanner, {0.0, 0.0, 0.0}), (4.0 * 5.0 + 10.0) / 5.0, 1e-12);
  EXPECT_EQ(mean_range_to({}, {0.0, 0.0, 0.0}), 0.0);
}

// The same by drawing beams: rays spread over each beam, the returns counted by where the middle of
// the beam passes.
double drawn_excess(const BeamFootprint& beam, double radius, Random& random) {
  constexpr int kBeams = 4000;
  constexpr int kRays = 400;
  const double reach = radius + 4.0 * beam.sd_m;
  const auto chance = [&](double across) {
    double part = 0.0;
    double energy = 0.0;
    for (int k = 0; k < kRays; ++k) {
      const double place = (across + random.normal(0.0, beam.sd_m)) / radius;
      if (std::abs(place) >= 1.0) continue;
      part += 1.0 / kRays;
      energy += std::max(0.08, std::sqrt(1.0 - place * place)) / kRays;
    }
    const double s = std::pow(beam.signal * energy, 3);
    const double p = std::pow(part / 0.1, 3);
    return s / (1.0 + s) * p / (1.0 + p);
  };
  double sum = 0.0;
  for (int i = 0; i < kBeams; ++i)
    sum += chance(random.uniform(0.0, reach));
  return reach * sum / kBeams / chance(0.0) - radius;
}

TEST(BeamFootprint, ExcessOfTheWidthIsThatOfDrawnBeams) {
  Random random(5);
  // Strong echoes make a stem wider, weak ones narrower.
  const BeamFootprint strong{0.012, 100.0};
  EXPECT_GT(excess_width_m(strong, 0.12), 0.01);
  EXPECT_NEAR(excess_width_m(strong, 0.12), drawn_excess(strong, 0.12, random), 0.0025);
  const BeamFootprint weak{0.03, 2.0};
  EXPECT_LT(excess_width_m(weak, 0.12), -0.01);
  EXPECT_NEAR(excess_width_m(weak, 0.12), drawn_excess(weak, 0.12, random), 0.0035);
  EXPECT_EQ(excess_width_m({}, 0.12), 0.0);
}

TEST(BeamFootprint, AStemSeenFromOneSideIsTooThick) {
  const BeamFootprint beam{0.012, 100.0};
  const double all_round = excess_radius_m(beam, 0.12, 360.0);
  EXPECT_GT(all_round, 0.003);
  EXPECT_LT(all_round, 0.012);
  EXPECT_NEAR(excess_radius_m(beam, 0.12, 180.0) - all_round, 0.46 * excess_width_m(beam, 0.12),
              1e-9);
  EXPECT_EQ(excess_radius_m({}, 0.12, 90.0), 0.0);
  // No correction takes a thin stem away.
  EXPECT_LE(excess_radius_m({0.05, 1000.0}, 0.03, 90.0), 0.4 * 0.03);
}

// The fit takes away more than the beams add.
TEST(BeamFootprint, WideBeamsMakeThinStemsTooThin) {
  const double narrow = excess_radius_m({0.008, 100.0}, 0.1, 360.0);
  const double wide = excess_radius_m({0.016, 100.0}, 0.1, 360.0);
  EXPECT_NEAR(2.0 * narrow - wide, 1.10 * 2.0 * 0.008 * 0.008 / 0.1, 1e-9);
  EXPECT_LT(excess_radius_m({0.016, 100.0}, 0.03, 360.0), 0.0);
}

TEST(BeamFootprint, DiametersAreSurerNearByAndWithKnownBeams) {
  const BeamConfig os1{LidarSensor::kOs1, 0.0, 0.0, 0.0};
  const double near = diameter_sd_m(0.001, 180.0, 5.0, footprint_at(os1, 5.0));
  const double far = diameter_sd_m(0.001, 180.0, 20.0, footprint_at(os1, 20.0));
  // Of a surface of 10 % half of the echoes return from 45 m, and bark has five times as much.
  const double weakness = 5.0 * 5.0 / (5.0 * 45.0 * 45.0);
  EXPECT_NEAR(near,
              std::sqrt(std::pow(2.3 * 0.002, 2) + std::pow(0.0057, 2) +
                        std::pow(0.0023 * 0.25, 2) + std::pow(0.0074 * weakness, 2)),
              1e-9);
  EXPECT_LT(near, far);
  EXPECT_LT(far, diameter_sd_m(0.001, 180.0, 20.0, {}));
  // Not known from where: the part that was not seen stands for the distance.
  EXPECT_LT(diameter_sd_m(0.001, 360.0, 0.0, {}), diameter_sd_m(0.001, 180.0, 0.0, {}));
}

TEST(BeamFootprint, DiametersAreLessSureWhereEchoesAreWeak) {
  const BeamFootprint strong{0.015, 50.0};
  const BeamFootprint weak{0.015, 3.0};
  EXPECT_NEAR(std::pow(diameter_sd_m(0.001, 180.0, 15.0, weak), 2) -
                  std::pow(diameter_sd_m(0.001, 180.0, 15.0, strong), 2),
              std::pow(0.0074 / 3.0, 2) - std::pow(0.0074 / 50.0, 2), 1e-9);
}

TEST(BeamFootprint, BeamsOfAnUnknownLidarAreAsWideAsUsual) {
  EXPECT_EQ(footprint_at(usual_beams("OS-0-128"), 10.0).sd_m,
            footprint_at({LidarSensor::kOs0}, 10.0).sd_m);
  EXPECT_GT(footprint_at(usual_beams(""), 10.0).sd_m, 0.01);
  EXPECT_EQ(footprint_at(usual_beams("VLP-16, single rays"), 10.0).sd_m, 0.0);
}

}  // namespace
}  // namespace understory
