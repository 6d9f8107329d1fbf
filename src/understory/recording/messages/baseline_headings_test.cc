#include "understory/recording/messages/baseline_headings.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDegrees = M_PI / 180.0;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Eigen::Vector3d earth_centred(double latitude_deg, double longitude_deg, double height_m) {
  const double s = std::sin(latitude_deg * kDegrees);
  const double c = std::cos(latitude_deg * kDegrees);
  const double e2 = 0.00669437999014;
  const double n = 6378137.0 / std::sqrt(1.0 - e2 * s * s);
  return {(n + height_m) * c * std::cos(longitude_deg * kDegrees),
          (n + height_m) * c * std::sin(longitude_deg * kDegrees), (n * (1.0 - e2) + height_m) * s};
}

// East, north, up from one fix to another, by earth-centred places.
Eigen::Vector3d line_of(const GnssFix& from, const GnssFix& to) {
  const double lat = from.latitude_deg * kDegrees;
  const double lon = from.longitude_deg * kDegrees;
  const Eigen::Vector3d d = earth_centred(to.latitude_deg, to.longitude_deg, to.height_m) -
                            earth_centred(from.latitude_deg, from.longitude_deg, from.height_m);
  const Eigen::Vector3d east(-std::sin(lon), std::cos(lon), 0.0);
  const Eigen::Vector3d up(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon),
                           std::sin(lat));
  return {d.dot(east), d.dot(up.cross(east)), d.dot(up)};
}

GnssFix fix_at(double east, double north, double up, double sd_m) {
  GnssFix fix;
  fix.latitude_deg = 63.3 + north / 111'500.0;  // about; line_of tells the line that it makes
  fix.longitude_deg = 30.2 + east / 50'180.0;
  fix.height_m = 150.0 + up;
  fix.quality = 4;
  fix.covariance = sd_m * sd_m * Eigen::Matrix3d::Identity();
  return fix;
}

BaselineHeadings antennas(double length_m) {
  BaselineHeadings headings;
  headings.set_length_m(length_m);
  return headings;
}

// As many pairs as it takes until there are headings.
void begin(BaselineHeadings& headings, const GnssFix& first, const GnssFix& second) {
  for (int i = 0; i < 4; ++i)
    EXPECT_FALSE(headings.add(first, second)) << i;
}

TEST(BaselineHeadings, AreThoseOfTheLineOnTheEarth) {
  for (const double turn_deg : {0.0, 37.0, 118.0, 250.0, 359.0}) {
    const GnssFix first = fix_at(0.0, 0.0, 0.0, 0.01);
    const GnssFix second =
        fix_at(1.2 * std::sin(turn_deg * kDegrees), 1.2 * std::cos(turn_deg * kDegrees), 0.3, 0.01);
    const Eigen::Vector3d line = line_of(first, second);
    BaselineHeadings headings = antennas(line.norm());
    begin(headings, first, second);
    const auto heading = headings.add(first, second);
    ASSERT_TRUE(heading);
    const double expected = std::atan2(line.x(), line.y()) / kDegrees;
    EXPECT_NEAR(std::remainder(heading->heading_deg - expected, 360.0), 0.0, 1e-4);
    EXPECT_GE(heading->heading_deg, 0.0);
    EXPECT_LT(heading->heading_deg, 360.0);
    EXPECT_NEAR(heading->sd_deg, 0.01 * std::sqrt(2.0) / line.head<2>().norm() / kDegrees, 1e-3);
    EXPECT_NEAR(headings.median_distance_m(), line.norm(), 1e-5);
    EXPECT_EQ(headings.contradicting(), 0U);
  }
}

TEST(BaselineHeadings, HaveTheUncertaintyAcrossTheLine) {
  const GnssFix first = fix_at(0.0, 0.0, 0.0, 0.01);
  GnssFix second = fix_at(0.0, 2.0, 0.0, 0.01);  // north of it: across is east
  second.covariance = Eigen::Vector3d(0.04 * 0.04, 0.5, 3.0).asDiagonal();
  BaselineHeadings headings = antennas(line_of(first, second).norm());
  begin(headings, first, second);
  const auto heading = headings.add(first, second);
  ASSERT_TRUE(heading);
  EXPECT_NEAR(heading->sd_deg, std::hypot(0.01, 0.04) / 2.0 / kDegrees, 2e-3);
}

// Receivers that promise a millimetre and err by two centimetres.
TEST(BaselineHeadings, AreAsUncertainAsTheDistancesScatter) {
  Random random(3);
  BaselineHeadings headings = antennas(1.0);
  double squares = 0.0;
  int count = 0;
  for (int i = 0; i < 2000; ++i) {
    const double turn = 0.003 * i;
    const auto noise = [&] { return 0.02 * random.normal(); };
    const GnssFix first = fix_at(noise(), noise(), noise(), 0.001);
    const GnssFix second =
        fix_at(std::sin(turn) + noise(), std::cos(turn) + noise(), noise(), 0.001);
    const auto heading = headings.add(first, second);
    if (!heading) continue;
    const double off = std::remainder(heading->heading_deg - turn / kDegrees, 360.0);
    squares += std::pow(off / heading->sd_deg, 2.0);
    ++count;
  }
  EXPECT_GT(count, 1900);
  EXPECT_NEAR(squares / count, 1.0, 0.25);
  EXPECT_LT(headings.contradicting(), 20U);
}

TEST(BaselineHeadings, APairThatIsTooFarApartIsCountedAndTellsNone) {
  const GnssFix first = fix_at(0.0, 0.0, 0.0, 0.01);
  const GnssFix second = fix_at(1.0, 0.0, 0.0, 0.01);
  const GnssFix away = fix_at(1.2, 0.0, 0.0, 0.01);
  BaselineHeadings headings = antennas(line_of(first, second).norm());
  begin(headings, first, second);
  for (int i = 1; i < 30; ++i) {
    const bool wrong = i % 3 == 0;
    const auto heading = headings.add(first, wrong ? away : second);
    EXPECT_EQ(heading.has_value(), !wrong) << i;
    if (heading) {
      EXPECT_LT(heading->sd_deg, 0.9);
    }
  }
  EXPECT_EQ(headings.pairs(), 33U);
  EXPECT_EQ(headings.contradicting(), 9U);
  EXPECT_FALSE(headings.most_contradict());
}

// Positions that err by as much as the antennas are apart: some are a metre apart by chance.
TEST(BaselineHeadings, ErrorsAsLongAsTheLineTellNone) {
  Random random(4);
  BaselineHeadings headings = antennas(1.0);
  for (int i = 0; i < 500; ++i) {
    const auto noise = [&] { return random.normal(); };
    const auto heading = headings.add(fix_at(noise(), noise(), noise(), 0.01),
                                      fix_at(1.0 + noise(), noise(), noise(), 0.01));
    EXPECT_FALSE(heading) << i;
  }
  EXPECT_TRUE(headings.most_contradict());
}

TEST(BaselineHeadings, ARigOfAnotherLengthTellsNone) {
  const GnssFix first = fix_at(0.0, 0.0, 0.0, 0.01);
  const GnssFix second = fix_at(1.0, 0.0, 0.0, 0.01);
  BaselineHeadings headings = antennas(2.0);
  for (int i = 0; i < 20; ++i)
    EXPECT_FALSE(headings.add(first, second));
  EXPECT_TRUE(headings.most_contradict());
  EXPECT_EQ(headings.contradicting(), 20U);
  // What was seen by another length does not count.
  headings.set_length_m(1.0);
  EXPECT_EQ(headings.pairs(), 0U);
  begin(headings, first, second);
  EXPECT_TRUE(headings.add(first, second));
  headings.set_length_m(std::nullopt);
  EXPECT_FALSE(headings.known());
  headings.set_length_m(0.05);
  EXPECT_FALSE(headings.known());
}

// Distances that agree with each other and not with the rig: something is wrong by a decimetre.
TEST(BaselineHeadings, ARigThatIsALittleWrongMakesThemUncertain) {
  const GnssFix first = fix_at(0.0, 0.0, 0.0, 0.01);
  const GnssFix second = fix_at(1.0, 0.0, 0.0, 0.01);
  const double distance = line_of(first, second).norm();
  BaselineHeadings headings = antennas(distance - 0.1);
  begin(headings, first, second);
  const auto heading = headings.add(first, second);
  ASSERT_TRUE(heading);
  EXPECT_NEAR(heading->sd_deg, 0.1 * 1.4826 / distance / kDegrees, 0.01);
}

TEST(BaselineHeadings, NeedPositionsHeightsAndALineThatIsNotSteep) {
  const GnssFix first = fix_at(0.0, 0.0, 0.0, 0.01);
  const GnssFix second = fix_at(1.0, 0.0, 0.0, 0.01);
  BaselineHeadings headings = antennas(1.0);
  for (int i = 0; i < 10; ++i)
    (void)headings.add(first, second);
  GnssFix without = second;
  without.quality = 0;
  EXPECT_FALSE(headings.add(first, without));
  without = second;
  without.height_m = kNaN;
  EXPECT_FALSE(headings.add(first, without));
  without.latitude_deg = kNaN;
  EXPECT_FALSE(headings.add(without, second));
  EXPECT_EQ(headings.pairs(), 10U);
  without = second;
  without.covariance.setConstant(kNaN);  // the scatter is what is left
  const auto heading = headings.add(first, without);
  ASSERT_TRUE(heading);
  EXPECT_LT(heading->sd_deg, 0.6);
  EXPECT_FALSE(headings.add(first, fix_at(0.45, 0.0, 0.893, 0.01)));  // 63 degrees
  EXPECT_EQ(headings.contradicting(), 0U);
}

TEST(SecondPositions, AreTakenBetweenTwoThatAreClose) {
  SecondPositions seconds;
  const auto add = [&](TimeNs stamp, double north, double sd) {
    GnssFix fix = fix_at(0.0, north, 2.0 * north, sd);
    fix.stamp = stamp;
    seconds.add(fix);
  };
  add(1'000'000'000, 0.0, 0.1);
  EXPECT_FALSE(seconds.at(1'050'000'000));  // nothing behind it yet
  add(1'200'000'000, 1.0, 0.2);
  const auto between = seconds.at(1'050'000'000);
  ASSERT_TRUE(between);
  EXPECT_NEAR(between->latitude_deg, fix_at(0.0, 0.25, 0.0, 0.0).latitude_deg, 1e-12);
  EXPECT_NEAR(between->height_m, 150.5, 1e-9);
  EXPECT_NEAR(between->covariance(0, 0), 0.75 * 0.01 + 0.25 * 0.04, 1e-12);
  EXPECT_EQ(between->stamp, 1'050'000'000);
  EXPECT_EQ(seconds.at(1'199'500'000)->height_m, 152.0);  // of one moment
  EXPECT_FALSE(seconds.at(990'000'000));                  // before the first
  // Too long a gap for a straight line.
  add(1'500'000'000, 2.0, 0.2);
  EXPECT_FALSE(seconds.at(1'300'000'000));
  // Stamps as messages come: the nearest, less certain by 20 ms of the way, a metre and two up in
  // 0.3 s.
  const auto near = seconds.near(1'520'000'000);
  ASSERT_TRUE(near);
  EXPECT_EQ(near->height_m, 154.0);
  EXPECT_NEAR(near->covariance(0, 0), 0.04 + std::pow(0.02 / 0.3, 2.0) * 5.0, 1e-4);
  EXPECT_FALSE(seconds.near(1'530'000'000));
  add(900'000'000, 0.0, 0.1);  // time goes back
  EXPECT_FALSE(seconds.near(1'520'000'000));
}

TEST(BaselineHeadings, GoOnWhereTheyWereSaved) {
  Random random(5);
  BaselineHeadings headings = antennas(1.0);
  SecondPositions seconds;
  const auto pair = [&] {
    return std::pair(fix_at(0.03 * random.normal(), 0.0, 0.0, 0.01), fix_at(1.0, 0.0, 0.0, 0.01));
  };
  for (int i = 0; i < 40; ++i) {
    const auto [first, second] = pair();
    (void)headings.add(first, second);
    GnssFix timed = second;
    timed.stamp = i * 200'000'000LL;
    seconds.add(timed);
  }
  BinaryWriter writer;
  headings.save(writer);
  seconds.save(writer);
  BinaryReader reader(writer.bytes(), "test");
  BaselineHeadings again;
  SecondPositions seconds_again;
  again.load(reader);
  seconds_again.load(reader);
  EXPECT_EQ(again.contradicting(), headings.contradicting());
  EXPECT_EQ(again.pairs(), 40U);
  EXPECT_EQ(again.length_m(), 1.0);
  EXPECT_TRUE(seconds_again.at(38 * 200'000'000LL + 100'000'000LL));
  for (int i = 0; i < 20; ++i) {
    const auto [first, second] = pair();
    const auto one = headings.add(first, second);
    const auto other = again.add(first, second);
    ASSERT_EQ(one.has_value(), other.has_value());
    if (one) {
      EXPECT_EQ(one->sd_deg, other->sd_deg);
    }
  }
}

}  // namespace
}  // namespace understory
