#include "understory/georeference/satellites/second_antenna.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;

constexpr double kDeg = M_PI / 180.0;

Eigen::Quaterniond yaw(double degrees) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(degrees * kDeg, Vector3d::UnitZ()));
}

GnssFix with_heading(double heading_deg) {
  GnssFix fix;
  fix.heading_deg = heading_deg;
  return fix;
}

SatellitePair pair_of(double time_s, double turn_deg, double sd_deg) {
  SatellitePair pair;
  pair.time_s = time_s;
  pair.turn_rad = turn_deg * kDeg;
  pair.turn_sd_rad = sd_deg * kDeg;
  return pair;
}

// A heading is clockwise from north, a turn counter-clockwise from east.
TEST(SecondAntenna, AHeadingTellsTheTurnOfTheWorld) {
  EXPECT_NEAR(turn_by_heading(with_heading(90.0), {2.0, 0.0, 0.0}), 0.0, 1e-12);
  EXPECT_NEAR(turn_by_heading(with_heading(0.0), {2.0, 0.0, 0.0}), M_PI / 2.0, 1e-12);
  // Antennas across: the line points to the left, y, which is north there.
  EXPECT_NEAR(turn_by_heading(with_heading(0.0), {0.0, 0.7, 0.1}), 0.0, 1e-12);
  // Headings on both sides of north are neighbours.
  const double before = turn_by_heading(with_heading(359.9), {0.0, 1.0, 0.0});
  const double after = turn_by_heading(with_heading(0.1), {0.0, 1.0, 0.0});
  EXPECT_NEAR(before, 0.1 * kDeg, 1e-12);
  EXPECT_NEAR(after, -0.1 * kDeg, 1e-12);
}

TEST(SecondAntenna, AnUprightLineOrAnUnknownOneHasNoHeading) {
  EXPECT_TRUE(std::isnan(turn_by_heading(with_heading(10.0), {0.0, 0.5, 1.0})));
  EXPECT_TRUE(std::isnan(turn_by_heading(with_heading(10.0), Vector3d::Zero())));
  EXPECT_TRUE(std::isnan(turn_by_heading(with_heading(std::nan("")), Vector3d::UnitX())));
  EXPECT_FALSE(std::isnan(turn_by_heading(with_heading(10.0), {0.0, 0.7, 1.0})));
}

TEST(SecondAntenna, AReceiverThatDoesNotSayHowGoodItIsIsTakenAsUsual) {
  GnssFix fix = with_heading(10.0);
  EXPECT_DOUBLE_EQ(turn_sd_rad(fix, 0.5), 0.5 * kDeg);
  fix.heading_sd_deg = 0.0;
  EXPECT_DOUBLE_EQ(turn_sd_rad(fix, 0.5), 0.5 * kDeg);
  fix.heading_sd_deg = 2.0;
  EXPECT_DOUBLE_EQ(turn_sd_rad(fix, 0.5), 2.0 * kDeg);
}

// The body turns at its place; the antennas stand askew on it. All pairs tell the same turn.
TEST(SecondAntenna, PairsTellTheTurnWhereverTheBodyLooks) {
  constexpr double kTurnDeg = 175.0;  // so that turns lie on both sides of the cut
  PairingConfig config;
  config.antenna_in_body = {0.2, -0.1, 1.0};
  config.second_antenna_in_body = Vector3d(0.7, 0.4, 1.2);
  const Vector3d line = *config.second_antenna_in_body - config.antenna_in_body;
  std::vector<StampedPose> path;
  std::vector<GnssFix> fixes;
  for (int k = 0; k <= 200; ++k) {
    const double body_deg = 3.6 * k;
    path.push_back({k * kNsPerSecond / 10, Pose(yaw(body_deg), Vector3d(1.0, 2.0, 0.0))});
    if (k % 2 == 0) continue;  // fixes between the poses
    GnssFix fix;
    fix.stamp = path.back().stamp - kNsPerSecond / 20;
    fix.latitude_deg = 61.0;
    fix.longitude_deg = 25.0;
    const Vector3d in_enu = yaw(kTurnDeg + 3.6 * (k - 0.5)) * line;
    fix.heading_deg = std::fmod(std::atan2(in_enu.x(), in_enu.y()) / kDeg + 360.0, 360.0);
    fixes.push_back(fix);
  }
  const SatellitePairs pairs = pair_by_time(path, fixes, config);
  ASSERT_GT(pairs.pairs.size(), 15U);
  for (const SatellitePair& pair : pairs.pairs) {
    EXPECT_NEAR(std::remainder(pair.turn_rad - kTurnDeg * kDeg, 2.0 * M_PI), 0.0, 1e-3);
    EXPECT_NEAR(pair.turn_sd_rad, config.heading_sd_deg * kDeg, 1e-12);
  }
  const auto turn = turn_by_headings(pairs.pairs, {});
  ASSERT_TRUE(turn);
  EXPECT_NEAR(std::remainder(turn->turn_rad - kTurnDeg * kDeg, 2.0 * M_PI), 0.0, 1e-3);
  EXPECT_EQ(turn->pairs, pairs.pairs.size());
  // Without the place of the second antenna they say nothing.
  config.second_antenna_in_body.reset();
  const SatellitePairs without = pair_by_time(path, fixes, config);
  EXPECT_FALSE(turn_by_headings(without.pairs, {}));
}

TEST(SecondAntenna, AFewWrongHeadingsDoNotMoveTheTurn) {
  std::vector<SatellitePair> pairs;
  Random random(5);
  for (int k = 0; k < 101; ++k) {
    const bool wrong = k % 5 == 0;
    pairs.push_back(pair_of(k, wrong ? 100.0 : 179.9 + 0.5 * random.normal(), 0.5));
  }
  const auto turn = turn_by_headings(pairs, {});
  ASSERT_TRUE(turn);
  EXPECT_NEAR(std::remainder(turn->turn_rad - 179.9 * kDeg, 2.0 * M_PI), 0.0, 0.3 * kDeg);
  // A hundred seconds are four independent headings, and the line itself is not known better.
  EXPECT_GT(turn->sd_rad, 0.3 * kDeg);
  EXPECT_LT(turn->sd_rad, 0.6 * kDeg);
  EXPECT_FALSE(turn_by_headings({pairs[1], pairs[2]}, {}));
}

TEST(SecondAntenna, PositionsContradictATurnOnlyWhereTheyKnowBetter) {
  const SecondAntennaConfig config;
  EXPECT_TRUE(contradicts(M_PI, 0.01, 0.1, config));
  EXPECT_TRUE(contradicts(-0.5, 0.01, 0.1, config));
  EXPECT_FALSE(contradicts(0.3, 0.01, 0.1, config));
  EXPECT_FALSE(contradicts(M_PI, 0.01, 1.0, config));
  EXPECT_FALSE(contradicts(2.0 * M_PI + 0.01, 0.01, 0.1, config));
}

TEST(SecondAntenna, TheFilterKnowsTheTurnAsWellAsItsErrorsAllow) {
  const SecondAntennaConfig config;
  double squares = 0.0;
  double stated = 0.0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(static_cast<std::uint64_t>(draw + 1));
    TurnFilter filter(config);
    double slow = random.normal();
    const double kept = std::exp(-1.0 / 20.0);
    for (int k = 0; k < 300; ++k) {
      slow = kept * slow + std::sqrt(1.0 - kept * kept) * random.normal();
      filter.add(pair_of(k, -179.5 + 0.8 * slow, 0.8), 0.0);
    }
    squares += std::pow(std::remainder(filter.turn_rad() + 179.5 * kDeg, 2.0 * M_PI), 2.0);
    stated += std::pow(filter.sd_rad(), 2.0) - std::pow(config.baseline_sd_deg * kDeg, 2.0);
  }
  EXPECT_LT(squares / stated, 1.5);
  EXPECT_GT(squares / stated, 0.4);
}

TEST(SecondAntenna, TheFilterLeavesOutWhatIsFarOffAndBeginsAnewWhereItStays) {
  TurnFilter filter{SecondAntennaConfig()};
  EXPECT_FALSE(filter.known());
  for (int k = 0; k < 20; ++k)
    filter.add(pair_of(k, 10.0, 0.5), 0.0);
  filter.add(pair_of(20, 190.0, 0.5), 0.0);
  filter.add(pair_of(21, std::nan(""), 0.5), 0.0);
  EXPECT_NEAR(filter.turn_rad(), 10.0 * kDeg, 1e-9);
  BinaryWriter writer;
  filter.save(writer);
  TurnFilter copy{SecondAntennaConfig()};
  BinaryReader reader(writer.bytes(), "test");
  copy.load(reader);
  for (int k = 22; k < 60; ++k) {
    filter.add(pair_of(k, 190.0, 0.5), 0.0);
    copy.add(pair_of(k, 190.0, 0.5), 0.0);
  }
  EXPECT_NEAR(std::remainder(filter.turn_rad() - 190.0 * kDeg, 2.0 * M_PI), 0.0, 1e-9);
  EXPECT_EQ(filter.turn_rad(), copy.turn_rad());
  EXPECT_EQ(filter.sd_rad(), copy.sd_rad());
  filter.forget();
  EXPECT_FALSE(filter.known());
}

}  // namespace
}  // namespace understory
