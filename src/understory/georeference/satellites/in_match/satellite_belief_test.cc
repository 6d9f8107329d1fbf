#include "understory/georeference/satellites/in_match/satellite_belief.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <string>

#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;

const GeodeticPlace kSleighPlace{47.3, -71.2, 640.0};
const Vector3d kSleighArm(-0.3, 0.3, 1.5);
const Pose kEnuFromSleighWorld(Eigen::Quaterniond(Eigen::AngleAxisd(1.9, Vector3d::UnitZ())),
                               Vector3d(8.0, -5.0, 2.0));

constexpr double kStatedVariance = 3.0 * 0.03 * 0.03;

TimeNs stamp(double time_s) {
  return 500 * kNsPerSecond + from_seconds(time_s);
}

// A sleigh that stands for 5 s and then goes 2 m/s in bends.
Pose sleigh_at(double time_s) {
  const double way_m = 2.0 * std::max(0.0, time_s - 5.0);
  const double heading = 0.5 * std::sin(0.03 * way_m);
  const Vector3d place(way_m, 0.5 / 0.03 * (1.0 - std::cos(0.03 * way_m)), 0.0);
  return {Eigen::Quaterniond(Eigen::AngleAxisd(heading, Vector3d::UnitZ())), place};
}

// What an odometry makes of it: after `from_s` its heading drifts by `drift_deg` each 100 m.
class Sleigh {
 public:
  explicit Sleigh(const SatelliteBeliefConfig& config, double drift_deg = 0.0, double from_s = 1e9)
      : belief_(config, 0.05), random_(3), drift_deg_(drift_deg), from_s_(from_s) {}

  void until(double time_s) {
    while (0.1 * steps_ <= time_s)
      step();
  }
  void step() {
    const double time_s = 0.1 * steps_;
    if (steps_ % 2 == 0) belief_.add_fix(fix_at(time_s - early_s_), kSleighArm, told_second_);
    const Pose truth = true_body(time_s);
    const Pose moved = steps_ > 0 ? true_body(time_s - 0.1).inverse() * truth : Pose();
    const double metres = moved.translation().norm();
    const double turn = time_s > from_s_ ? drift_deg_ * kDegree * metres / 100.0 : 0.0;
    odometry_ =
        steps_ > 0 ? odometry_ * moved * Pose(so3_exp({0.0, 0.0, turn}), Vector3d::Zero()) : truth;
    belief_.add_pose({stamp(time_s), world_from_first_ * odometry_});
    ++steps_;
  }
  // Fixes come so long before the scans.
  void set_early(double early_s) { early_s_ = early_s; }
  // A second antenna, and where it is said to be.
  void set_second(const Vector3d& in_body, const Vector3d& told) {
    second_ = in_body;
    told_second_ = told;
  }
  void jump(const Vector3d& metres) { jump_ = metres; }
  void stand() { stands_from_s_ = 0.1 * steps_; }
  void move(const Pose& motion, bool level) {
    world_from_first_ = motion * world_from_first_;
    level ? belief_.level_world(motion) : belief_.move_present(motion);
  }
  [[nodiscard]] Pose world_from_body() const { return world_from_first_ * odometry_; }
  [[nodiscard]] Pose truth() const { return true_body(0.1 * (steps_ - 1)); }
  [[nodiscard]] std::optional<PoseBelief> belief() const {
    return belief_.at({stamp(0.1 * (steps_ - 1)), world_from_body()});
  }
  SatelliteBelief& filter() { return belief_; }

 private:
  [[nodiscard]] Pose true_body(double time_s) const {
    return sleigh_at(std::min(time_s, stands_from_s_));
  }
  GnssFix fix_at(double time_s) {
    const double x = random_.normal();
    const double y = random_.normal();
    const Vector3d error = 0.02 * Vector3d(x, y, random_.normal());
    const GeodeticPlace place =
        EastNorthUp(kSleighPlace)
            .to_place(kEnuFromSleighWorld * (true_body(time_s) * kSleighArm) + error + jump_);
    GnssFix fix;
    fix.stamp = stamp(time_s);
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = place.height_m;
    fix.covariance = kStatedVariance / 3.0 * Eigen::Matrix3d::Identity();
    fix.quality = 4;
    if (!second_) return fix;
    const Vector3d line =
        kEnuFromSleighWorld.rotation() * (true_body(time_s).rotation() * (*second_ - kSleighArm));
    fix.heading_deg = std::remainder(std::atan2(line.x(), line.y()) / kDegree, 360.0);
    if (fix.heading_deg < 0.0) fix.heading_deg += 360.0;
    fix.heading_sd_deg = 0.2;
    return fix;
  }

  SatelliteBelief belief_;
  Random random_;
  double drift_deg_;
  double from_s_;
  double early_s_ = 0.0;
  std::optional<Vector3d> second_;
  std::optional<Vector3d> told_second_;
  double stands_from_s_ = 1e9;
  Vector3d jump_ = Vector3d::Zero();
  Pose odometry_;
  Pose world_from_first_;
  int steps_ = 0;
};

SatelliteBeliefConfig with(SatellitesInMatch use) {
  SatelliteBeliefConfig config;
  config.use = use;
  config.first_heading_sd_deg = 0.1;
  config.free_sd = 0.0;
  return config;
}

double heading_difference(const Pose& a, const Pose& b) {
  return so3_log(a.rotation() * b.rotation().conjugate()).z();
}

// P3 section 5.1: a short first stretch tells the heading; a sleigh that stands tells none.
TEST(SatelliteBelief, BeginsAfterAFirstStretch) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty));
  sleigh.until(5.0);
  EXPECT_FALSE(sleigh.filter().aligned());
  EXPECT_FALSE(sleigh.belief().has_value());
  sleigh.until(60.0);
  ASSERT_TRUE(sleigh.filter().aligned());
  EXPECT_GT(sleigh.filter().aligned_at(), stamp(5.0));
  const auto belief = sleigh.belief();
  ASSERT_TRUE(belief.has_value());
  // Where the odometry is right, it agrees.
  EXPECT_LT((belief->target_from_source * kSleighArm - sleigh.truth() * kSleighArm).norm(), 0.4);
  EXPECT_LT(std::abs(heading_difference(belief->target_from_source, sleigh.truth())), 0.01);
  EXPECT_EQ(belief->point_in_source, kSleighArm);
}

// What the penalty is for: the map has drifted, the belief has not.
TEST(SatelliteBelief, StaysWhereTheFirstStretchLaidTheWorldWhileTheOdometryDrifts) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty), 1.0, 60.0);
  sleigh.until(340.0);  // 560 m later
  ASSERT_TRUE(sleigh.filter().aligned());
  const auto belief = sleigh.belief();
  ASSERT_TRUE(belief.has_value());
  const Vector3d drifted = sleigh.world_from_body() * kSleighArm - sleigh.truth() * kSleighArm;
  const Vector3d error = belief->target_from_source * kSleighArm - sleigh.truth() * kSleighArm;
  EXPECT_GT(drifted.norm(), 15.0);
  EXPECT_LT(error.norm(), 2.0) << "0.2 degrees of the first stretch's heading over 600 m";
  EXPECT_GT(heading_difference(sleigh.world_from_body(), sleigh.truth()), 5.0 * kDegree);
  EXPECT_LT(std::abs(heading_difference(belief->target_from_source, sleigh.truth())),
            3.0 * kDegree);
}

// At 2 m/s a fix lies 10 cm before the scan that comes 0.05 s after it.
TEST(SatelliteBelief, AFixBetweenTwoScansIsCarriedOnFromItsOwnTime) {
  Sleigh together(with(SatellitesInMatch::kPenalty));
  Sleigh between = together;
  between.set_early(0.05);
  together.until(60.0);
  between.until(60.0);
  ASSERT_TRUE(between.filter().aligned());
  double along_m = 0.0;
  constexpr int kSteps = 100;
  for (int step = 0; step < kSteps; ++step) {
    together.step();
    between.step();
    const Vector3d ahead = between.truth().rotation() * Vector3d::UnitX();
    along_m += ahead.dot(between.belief()->target_from_source * kSleighArm -
                         together.belief()->target_from_source * kSleighArm) /
               kSteps;
  }
  EXPECT_LT(std::abs(along_m), 0.04);
}

// A receiver that jumps and goes on saying centimetres.
TEST(SatelliteBelief, AFixThatLeavesTheWayOfTheOdometryCountsLess) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty));
  sleigh.until(60.0);
  const double before = sleigh.belief()->position_covariance.trace();
  sleigh.jump(Vector3d(1.0, -0.5, 0.0));
  sleigh.step();
  sleigh.step();
  EXPECT_GT(sleigh.belief()->position_covariance.trace(), 25.0 * before);
  sleigh.until(100.0);
  EXPECT_GT(sleigh.belief()->position_covariance.trace(), 25.0 * before) << "it is still there";
  sleigh.jump(Vector3d::Zero());
  sleigh.until(120.0);
  EXPECT_NEAR(sleigh.belief()->position_covariance.trace(), before, 1e-9) << "it has come back";
}

// The vertical of the IMU, whatever the map's is.
TEST(SatelliteBelief, GravityIsTheImus) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty));
  sleigh.until(60.0);
  const Eigen::Quaterniond level = so3_exp(Vector3d(0.02, -0.01, 0.0));
  const auto belief = sleigh.filter().at({stamp(60.0), sleigh.world_from_body()}, level);
  ASSERT_TRUE(belief.has_value());
  const Vector3d up = belief->target_from_source.rotation().conjugate() * Vector3d::UnitZ();
  const Vector3d expected =
      sleigh.world_from_body().rotation().conjugate() * (level.conjugate() * Vector3d::UnitZ());
  EXPECT_LT((up - expected).norm(), 1e-9);
  EXPECT_LT(
      (belief->target_from_source * kSleighArm - sleigh.belief()->target_from_source * kSleighArm)
          .norm(),
      1e-9)
      << "the antenna stays at the fix";
}

// A receiver's error stays for minutes: what it explains is no drift.
TEST(SatelliteBelief, AFixSaysNothingOfWhatItsOwnErrorExplains) {
  SatelliteBeliefConfig config = with(SatellitesInMatch::kPenalty);
  Sleigh to_the_fix(config);
  config.free_sd = 18.0;
  const double sd = std::sqrt(kStatedVariance / 3.0 + 0.01 * 0.01);
  config.followed_sd_m = sd / 3.0;  // free are 12 standard deviations
  Sleigh sleigh(config);
  for (Sleigh* each : {&to_the_fix, &sleigh})
    each->until(60.0);
  ASSERT_TRUE(sleigh.filter().aligned());
  EXPECT_FALSE(sleigh.belief().has_value());
  const Vector3d fix = to_the_fix.belief()->target_from_source * kSleighArm;
  // A loop moves the path off the fixes.
  sleigh.move(Pose(Eigen::Quaterniond::Identity(), Vector3d(4.0, 0.0, 0.0)), false);
  const auto ahead = sleigh.belief();
  ASSERT_TRUE(ahead.has_value());
  const Vector3d left = ahead->target_from_source * kSleighArm - fix;
  EXPECT_NEAR(left.head<2>().norm(), 12.0 * sd, 1e-6) << "the edge of what it allows";
  EXPECT_LT(ahead->position_covariance(0, 0), 0.1);
  EXPECT_GT(ahead->position_covariance(2, 2), 1e5) << "of the height it says nothing";
  config.followed_sd_m = 2.0 * sd;
  Sleigh good(config);
  good.until(60.0);
  EXPECT_LT((good.belief()->target_from_source * kSleighArm - fix).norm(), 1e-9)
      << "it is followed";
  sleigh.move(Pose(Eigen::Quaterniond::Identity(), Vector3d(-4.0, 0.0, 1.0)), false);
  const auto above = sleigh.belief();
  ASSERT_TRUE(above.has_value());
  EXPECT_GT(above->position_covariance(0, 0), 1e5) << "nor of the plane";
  EXPECT_LT(above->position_covariance(2, 2), 0.1);
}

// A sleigh slips: its course is degrees off the way it looks. That must not move the place where
// the position pulls, metres ahead of the antenna.
TEST(SatelliteBelief, TheCentreOfTurningIsAsFarOffAsTheAntenna) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty));
  sleigh.until(60.0);
  const Vector3d centre(8.0, 0.0, 0.5);
  Matrix6d information = 1e4 * Matrix6d::Identity();
  information.topRightCorner<3, 3>() = 1e4 * skew(centre);
  information.bottomLeftCorner<3, 3>() = 1e4 * skew(centre).transpose();
  sleigh.filter().note_match(information);
  const Pose here = sleigh.world_from_body();
  const Eigen::Quaterniond slipped = so3_exp(Vector3d(0.0, 0.0, 6.0 * kDegree)) * here.rotation();
  const Pose predicted(slipped, here * kSleighArm - slipped * kSleighArm);
  const auto belief = sleigh.filter().at({stamp(60.0), predicted});
  ASSERT_TRUE(belief.has_value());
  EXPECT_LT((belief->point_in_source - centre).norm(), 1e-6);
  EXPECT_LT(heading_difference(belief->target_from_source, predicted), -2.0 * kDegree)
      << "the course says so";
  EXPECT_LT((belief->target_from_source * centre - predicted * centre).norm(), 0.15);
  EXPECT_LT(belief->position_covariance.topLeftCorner(2, 2).trace(), 0.02);
}

// P3 section 5.2 has a carrier that stands without a heading; two antennas have one.
TEST(SatelliteBelief, ASecondAntennaTellsTheHeadingOfACarrierThatStands) {
  const Vector3d second(0.9, -0.5, 1.4);
  Sleigh sleigh(with(SatellitesInMatch::kPenalty), 1.0, 60.0);
  sleigh.set_second(second, second);
  sleigh.until(160.0);
  sleigh.stand();
  sleigh.until(190.0);
  EXPECT_GT(heading_difference(sleigh.world_from_body(), sleigh.truth()), 1.5 * kDegree);
  const TimeNs now = stamp(190.0);
  const auto heading = sleigh.filter().heading_at({now, sleigh.world_from_body()});
  ASSERT_TRUE(heading.has_value());
  EXPECT_LT(std::abs(heading_difference(heading->target_from_source, sleigh.truth())),
            0.4 * kDegree);
  EXPECT_NEAR(std::sqrt(heading->attitude_covariance(2, 2)), std::hypot(0.2, 0.3) * kDegree, 1e-6);
  EXPECT_GT(heading->attitude_covariance(0, 0), 10.0);
  EXPECT_NEAR(sleigh.belief()->attitude_covariance(2, 2), heading->attitude_covariance(2, 2), 1e-9);
  // A loop has turned the map by a degree: the heading is where it was.
  const Pose turn(so3_exp(Vector3d(0.0, 0.0, 1.0 * kDegree)), Vector3d::Zero());
  sleigh.move(turn, false);
  const auto later = sleigh.filter().heading_at({now, sleigh.world_from_body()});
  EXPECT_NEAR(heading_difference(later->target_from_source, heading->target_from_source), 0.0,
              1e-6);
  // A levelled world has turned with it.
  sleigh.move(turn, true);
  const auto level = sleigh.filter().heading_at({now, sleigh.world_from_body()});
  EXPECT_NEAR(heading_difference(level->target_from_source, later->target_from_source),
              1.0 * kDegree, 1e-3);
}

// Its places on the body are swapped: it says 180 degrees, which no map drifts.
TEST(SatelliteBelief, AHeadingThatNoDriftExplainsDoesNotCount) {
  const Vector3d second(0.9, -0.5, 1.4);
  Sleigh sleigh(with(SatellitesInMatch::kPenalty));
  sleigh.set_second(second, 2.0 * kSleighArm - second);
  sleigh.until(90.0);
  ASSERT_TRUE(sleigh.filter().aligned());
  EXPECT_FALSE(sleigh.filter().heading_at({stamp(90.0), sleigh.world_from_body()}).has_value());
  ASSERT_TRUE(sleigh.belief().has_value());
  EXPECT_LT(std::abs(heading_difference(sleigh.belief()->target_from_source, sleigh.truth())),
            3.0 * kDegree);
}

// What a map may take over of a place: RTK, and the path where it says.
TEST(SatelliteBelief, HoldsAPathThatLiesAtItsFixes) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty), 1.0, 60.0);
  EXPECT_FALSE(sleigh.filter().holds());
  sleigh.until(60.0);
  EXPECT_TRUE(sleigh.filter().holds());
  sleigh.until(200.0);
  EXPECT_FALSE(sleigh.filter().holds()) << "the path has drifted by metres";
}

// While it stands nothing tells its heading, P3 section 5.2.
TEST(SatelliteBelief, ACarrierThatStandsHasNoHeading) {
  Sleigh sleigh(with(SatellitesInMatch::kPenalty));
  sleigh.until(60.0);
  EXPECT_LT(sleigh.belief()->attitude_covariance(2, 2), 0.1);
  sleigh.stand();
  sleigh.until(90.0);
  EXPECT_GT(sleigh.belief()->attitude_covariance(2, 2), 10.0);
  EXPECT_LT(sleigh.belief()->attitude_covariance(0, 0), 0.01);
}

// The prior is the fix itself; its heading follows the course.
TEST(SatelliteBelief, ThePriorIsTheFixAndTheCourse) {
  Sleigh sleigh(with(SatellitesInMatch::kPrior), 1.2, 100.0);
  sleigh.until(250.0);
  const auto belief = sleigh.belief();
  ASSERT_TRUE(belief.has_value());
  EXPECT_LT((belief->target_from_source * kSleighArm - sleigh.truth() * kSleighArm).norm(), 1.0);
  const double off = heading_difference(sleigh.world_from_body(), sleigh.truth());
  EXPECT_GT(off, 3.0 * kDegree);
  EXPECT_LT(std::abs(heading_difference(belief->target_from_source, sleigh.truth())),
            2.5 * kDegree);
  EXPECT_NEAR(belief->position_covariance.trace(), kStatedVariance + 3.0 * 0.01 * 0.01, 1e-9)
      << "stated, and the least that a fix can be";
  EXPECT_GT(belief->attitude_covariance(0, 0), 10.0) << "nothing tells roll";
}

// An old fix says nothing.
TEST(SatelliteBelief, ThePriorOfAnOldFixIsNone) {
  Sleigh sleigh(with(SatellitesInMatch::kPrior));
  sleigh.until(60.0);
  ASSERT_TRUE(sleigh.belief().has_value());
  EXPECT_FALSE(sleigh.filter().at({stamp(62.0), sleigh.world_from_body()}).has_value());
}

// A levelled world takes the belief along. A loop moves the present alone: the belief stays.
TEST(SatelliteBelief, LevellingTakesItAlongAndALoopDoesNot) {
  const Pose turn(so3_exp(Vector3d(0.0, 0.0, 0.3)), Vector3d(1.0, -2.0, 0.5));
  Sleigh still(with(SatellitesInMatch::kPenalty));
  Sleigh levelled = still;
  Sleigh looped = still;
  for (Sleigh* each : {&still, &levelled, &looped})
    each->until(60.0);
  levelled.move(turn, true);
  looped.move(turn, false);
  for (Sleigh* each : {&still, &levelled, &looped})
    each->step();
  const Vector3d before = still.belief()->target_from_source * kSleighArm;
  EXPECT_LT((levelled.belief()->target_from_source * kSleighArm - turn * before).norm(), 0.02);
  EXPECT_LT((looped.belief()->target_from_source * kSleighArm - before).norm(), 0.1)
      << "the last step of 0.2 m turned with it";
}

// East, north, up was laid on a world that was not level yet. It is level in the new one.
TEST(SatelliteBelief, ALevelledWorldHasFixesAtTheirHeights) {
  SatelliteBeliefConfig config = with(SatellitesInMatch::kPenalty);
  config.place = PenaltyPlace::kAntenna;
  Sleigh sleigh(config);
  sleigh.until(60.0);
  const double before = (sleigh.belief()->target_from_source * kSleighArm).z();
  sleigh.move(Pose(so3_exp(Vector3d(0.05, -0.08, 0.0)), Vector3d::Zero()), true);
  sleigh.step();
  sleigh.step();
  const double after = (sleigh.belief()->target_from_source * kSleighArm).z();
  EXPECT_GT((sleigh.world_from_body() * kSleighArm).z(), before + 5.0) << "8 % of 110 m";
  // All the way from the end of the first stretch, 15 m from the origin, it lies level.
  EXPECT_LT(std::abs(after - before), 3.0);
}

TEST(SatelliteBelief, GoesOnFromItsState) {
  for (const SatellitesInMatch use : {SatellitesInMatch::kPenalty, SatellitesInMatch::kPrior}) {
    Sleigh sleigh(with(use), 1.0, 20.0);
    sleigh.until(70.0);
    BinaryWriter writer;
    sleigh.filter().save(writer);
    SatelliteBelief other(with(use), 0.05);
    const std::string state = writer.bytes();
    BinaryReader reader(state, "state");
    other.load(reader);
    Sleigh second = sleigh;
    second.filter() = other;
    sleigh.until(90.0);
    second.until(90.0);
    ASSERT_TRUE(sleigh.belief().has_value());
    EXPECT_EQ(sleigh.belief()->target_from_source.translation(),
              second.belief()->target_from_source.translation());
    EXPECT_EQ(sleigh.belief()->position_covariance, second.belief()->position_covariance);
  }
}

}  // namespace
}  // namespace understory
