#include "understory/georeference/satellites/satellite_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>

#include "understory/georeference/satellites/test_mast.h"
#include "understory/util/random.h"
#include "understory/util/time.h"

namespace understory {
namespace {

using Eigen::Vector3d;
using test::kArm;
using test::kPlace;

Pose enu_from_world() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(2.2, Vector3d::UnitZ())), {4.0, -3.0, 1.0}};
}

// A walk of ten minutes along two loops, a pose each half second; the body sways.
std::vector<StampedPose> walk() {
  std::vector<StampedPose> poses;
  for (int k = 0; k < 1200; ++k) {
    const double t = 0.5 * k;
    const Vector3d place(60.0 * std::sin(0.02 * t), 40.0 * std::sin(0.03 * t), std::sin(0.05 * t));
    const Eigen::Quaterniond turn =
        so3_exp({0.05 * std::sin(t), 0.05 * std::cos(0.7 * t), 0.02 * t});
    poses.push_back({from_seconds(1000.0 + t), Pose(turn, place)});
  }
  return poses;
}

struct Receiver {
  double slow_m = 0.0;
  double correlation_s = 60.0;
  double fast_m = 0.0;
  double height_factor = 2.0;
  double late_s = 0.0;
  double stated_m = 1.0;
};

std::vector<GnssFix> received(const std::vector<StampedPose>& poses, const Receiver& receiver,
                              std::uint64_t seed) {
  Random random(seed);
  const EastNorthUp frame(kPlace);
  const auto normal = [&] { return Vector3d(random.normal(), random.normal(), random.normal()); };
  Vector3d slow = normal();
  std::vector<GnssFix> fixes;
  const double kept = std::exp(-1.0 / receiver.correlation_s);
  for (std::size_t k = 0; k < poses.size(); k += 2) {
    slow = kept * slow + std::sqrt(1.0 - kept * kept) * normal();
    Vector3d error = receiver.slow_m * slow + receiver.fast_m * normal();
    error.z() *= receiver.height_factor;
    const GeodeticPlace place =
        frame.to_place(enu_from_world() * (poses[k].world_from_body * kArm) + error);
    GnssFix fix;
    fix.stamp = poses[k].stamp + from_seconds(receiver.late_s);
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = place.height_m;
    fix.covariance = receiver.stated_m * receiver.stated_m *
                     Vector3d(1.0, 1.0, receiver.height_factor * receiver.height_factor)
                         .asDiagonal()
                         .toDenseMatrix();
    fixes.push_back(fix);
  }
  return fixes;
}

SatelliteFitConfig usual_fit() {
  SatelliteFitConfig config;
  config.pairing.antenna_in_body = kArm;
  config.pairing.most_pairs = 80;  // quick
  return config;
}

// East, north, up at kPlace of a place of the run by a fit.
Vector3d placed(const SatelliteFit& fit, const Vector3d& place_in_world) {
  return EastNorthUp(kPlace).from_place(
      EastNorthUp(*fit.origin).to_place(fit.enu_from_world * place_in_world));
}

double rms_error_m(const SatelliteFit& fit, const std::vector<StampedPose>& poses) {
  double sum = 0.0;
  for (const StampedPose& pose : poses) {
    const Vector3d p = pose.world_from_body.translation();
    sum +=
        (placed(fit, p) - enu_from_world() * p).squaredNorm() / static_cast<double>(poses.size());
  }
  return std::sqrt(sum);
}

// A regression: a run that kept its heading said that it was level to 0.05 degrees, and was off by
// up to 0.35.
TEST(SatelliteFit, ARunThatKeptItsHeadingIsLessLevel) {
  std::vector<StampedPose> straight;
  std::vector<StampedPose> round;
  for (int k = 0; k < 360; ++k) {
    const Pose step(Eigen::Quaterniond::Identity(), {0.1 * k, 0.0, 0.0});
    straight.push_back({k * kNsPerSecond, step});
    const Eigen::AngleAxisd turn(k * M_PI / 180.0, Vector3d::UnitZ());
    round.push_back({k * kNsPerSecond, Pose(Eigen::Quaterniond(turn), Vector3d::Zero())});
  }
  EXPECT_DOUBLE_EQ(straightness(straight), 1.0);
  EXPECT_NEAR(straightness(round), 0.0, 1e-9);
  EXPECT_EQ(straightness({}), 0.0);
  const auto by_imu = [](const std::vector<StampedPose>& path) {
    return tilt_sd_deg(LevelledBy::kGravity, straightness(path));
  };
  EXPECT_NEAR(by_imu(round), 0.05, 1e-6);
  EXPECT_NEAR(by_imu(straight), 0.255, 1e-3);
  EXPECT_EQ(tilt_sd_deg(LevelledBy::kStems, 1.0), tilt_sd_deg(LevelledBy::kStems, 0.0));
}

TEST(SatelliteFit, EveryMethodLaysAPathOnGoodFixes) {
  const auto poses = walk();
  const auto fixes = received(poses, {0.01, 5.0, 0.01}, 3);
  for (const SatelliteMethod method :
       {SatelliteMethod::kClosed, SatelliteMethod::kFit3, SatelliteMethod::kSplit}) {
    const SatelliteFit fit = fit_to_satellites(poses, fixes, method, usual_fit());
    ASSERT_TRUE(fit.found) << fit.reason;
    EXPECT_LT(rms_error_m(fit, poses), 0.03);
    EXPECT_EQ(fit.fixes.size(), fixes.size());
    EXPECT_LT(fit.fixes[100].residual.norm(), 0.1);
  }
}

// The covariances of all methods hold under slow errors that the receiver understates, and the
// split fit is the best of them.
TEST(SatelliteFit, CovariancesHoldUnderSlowErrorsThatTheReceiverUnderstates) {
  const auto poses = walk();
  const Receiver receiver{3.0, 80.0, 0.5, 4.0, 0.0, 1.0};
  constexpr int kDraws = 40;
  std::array<double, 3> squared_errors{};
  for (int m = 0; m < 3; ++m) {
    const auto method = std::array{SatelliteMethod::kClosed, SatelliteMethod::kFit3,
                                   SatelliteMethod::kSplit}[static_cast<std::size_t>(m)];
    Vector6d squares = Vector6d::Zero();
    for (int draw = 0; draw < kDraws; ++draw) {
      const SatelliteFit fit =
          fit_to_satellites(poses, received(poses, receiver, static_cast<std::uint64_t>(draw + 50)),
                            method, usual_fit());
      ASSERT_TRUE(fit.found) << fit.reason;
      // Truth in the frame of the fit: its origin is the first fix.
      const EastNorthUp at(kPlace);
      const Vector3d origin = at.from_place(*fit.origin);
      const Pose truth(enu_from_world().rotation(), enu_from_world().translation() - origin);
      const Pose error = truth * fit.enu_from_world.inverse();
      Vector6d off;
      off << so3_log(error.rotation()),
          truth * (fit.enu_from_world.inverse() * fit.middle) - fit.middle;
      squares += off.cwiseAbs2().cwiseQuotient(fit.spread.diagonal()) / kDraws;
      squared_errors[static_cast<std::size_t>(m)] +=
          std::pow(rms_error_m(fit, poses), 2.0) / kDraws;
    }
    for (const int axis : {2, 3, 4, 5}) {
      // Wide: all pairs state the same error, so its steady part cannot be told from the slow one.
      EXPECT_GT(squares(axis), 0.25) << m << " " << axis;
      EXPECT_LT(squares(axis), 1.9) << m << " " << axis;
    }
    if (m == 2) continue;  // the tilt of the split fit comes from the run, which is level here
    EXPECT_GT(squares(0) + squares(1), 0.8) << m;
    EXPECT_LT(squares(0) + squares(1), 4.5) << m;  // fit3: 4.1
  }
  EXPECT_LT(squared_errors[2], 0.8 * squared_errors[0]);
  EXPECT_LT(squared_errors[2], 0.8 * squared_errors[1]);
}

TEST(SatelliteFit, ALateClockIsFoundWhereItIsLookedFor) {
  const auto poses = walk();
  const auto fixes = received(poses, {0.1, 20.0, 0.02, 2.0, 0.8}, 5);
  SatelliteFitConfig config = usual_fit();
  config.split.time_offset_sd_s = 1.0;
  const SatelliteFit fit = fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, config);
  ASSERT_TRUE(fit.found);
  EXPECT_NEAR(fit.time_offset_s, -0.8, 0.1);
  config = usual_fit();
  config.pairing.time_offset_s = -0.8;
  EXPECT_LT(fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, config).plane_rms_m, 0.3);
}

TEST(SatelliteFit, ABurstHasLittleSay) {
  const auto poses = walk();
  auto fixes = received(poses, {0.3, 20.0, 0.1}, 6);
  for (std::size_t k = 200; k < 260; ++k)
    fixes[k].latitude_deg += 3e-4;  // 33 m for a minute
  const SatelliteFit fit = fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, usual_fit());
  ASSERT_TRUE(fit.found);
  EXPECT_LT(rms_error_m(fit, poses), 0.8);
  EXPECT_FALSE(fit.fixes[230].used);
  EXPECT_TRUE(fit.fixes[100].used);
  SatelliteFitConfig plain = usual_fit();
  plain.split.robust = false;
  EXPECT_GT(rms_error_m(fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, plain), poses),
            1.0);
}

// P4 (45-52): poses of the body that a smoother gave, level to a milliradian, in the fixes' frame.
TEST(SatelliteFit, SixDegreesOfFreedomTakeTheTiltFromPoses) {
  const auto poses = walk();
  const auto fixes = received(poses, {3.0, 80.0, 0.3, 5.0}, 8);
  const SatelliteFit closed =
      fit_to_satellites(poses, fixes, SatelliteMethod::kClosed, usual_fit());
  ASSERT_TRUE(closed.found);
  const Vector3d origin = EastNorthUp(kPlace).from_place(*closed.origin);
  std::vector<SmoothedPose> smoothed;
  for (std::size_t k = 0; k < poses.size(); k += 10) {
    const Pose truth = enu_from_world() * poses[k].world_from_body;
    SmoothedPose pose;
    pose.stamp = poses[k].stamp;
    pose.enu_from_body = Pose(truth.rotation(), truth.translation() - origin) *
                         Pose::exp((Vector6d() << 0.001, -0.001, 0.001, 0, 0, 0).finished());
    pose.covariance = (Vector6d() << 1e-6, 1e-6, 1e-4, 4.0, 4.0, 100.0).finished().asDiagonal();
    smoothed.push_back(pose);
  }
  const SatelliteFit six =
      fit_to_satellites(poses, fixes, SatelliteMethod::kFit6, usual_fit(), smoothed);
  ASSERT_TRUE(six.found) << six.reason;
  const auto tilt = [](const SatelliteFit& fit) {
    return std::acos((fit.enu_from_world.rotation() * Vector3d::UnitZ()).z());
  };
  EXPECT_LT(tilt(six), 0.003);
  EXPECT_GT(tilt(closed), 0.01);
  EXPECT_FALSE(fit_to_satellites(poses, fixes, SatelliteMethod::kFit6, usual_fit()).found);
}

TEST(SatelliteFit, SaysWhatIsWrongWithTheFixes) {
  const auto poses = walk();
  const auto good = received(poses, {0.5, 20.0, 0.1}, 9);
  auto other_day = good;
  for (GnssFix& fix : other_day)
    fix.stamp += from_seconds(86400.0);
  const SatelliteFit late =
      fit_to_satellites(poses, other_day, SatelliteMethod::kSplit, usual_fit());
  EXPECT_FALSE(late.found);
  EXPECT_NE(late.reason.find("1970-01-02"), std::string::npos) << late.reason;
  EXPECT_FALSE(fit_to_satellites(poses, {}, SatelliteMethod::kSplit, usual_fit()).found);
  auto swapped = good;
  for (GnssFix& fix : swapped)
    std::swap(fix.latitude_deg, fix.longitude_deg);
  EXPECT_TRUE(fit_to_satellites(poses, swapped, SatelliteMethod::kSplit, usual_fit()).swapped);
  EXPECT_FALSE(fit_to_satellites(poses, good, SatelliteMethod::kSplit, usual_fit()).swapped);
  auto flat = good;
  for (GnssFix& fix : flat)
    fix.height_m = std::nan("");
  EXPECT_FALSE(fit_to_satellites(poses, flat, SatelliteMethod::kClosed, usual_fit()).found);
  const SatelliteFit plane = fit_to_satellites(poses, flat, SatelliteMethod::kSplit, usual_fit());
  ASSERT_TRUE(plane.found) << plane.reason;
  EXPECT_FALSE(plane.height_known);
  std::vector<StampedPose> still(poses.size(), poses.front());
  for (std::size_t k = 0; k < poses.size(); ++k)
    still[k].stamp = poses[k].stamp;
  const SatelliteFit one = fit_to_satellites(still, good, SatelliteMethod::kSplit, usual_fit());
  EXPECT_FALSE(one.found);
  EXPECT_NE(one.reason.find("spans"), std::string::npos) << one.reason;
}

TEST(SatelliteFit, CovarianceOfFixesComesFromTheReceiverOrItsDilution) {
  GnssFix fix;
  const FixCovarianceConfig config;
  EXPECT_NEAR(fix_covariance(fix, config)(0, 0), 4.0, 1e-3);
  fix.hdop = 2.0;
  fix.vdop = 3.0;
  EXPECT_NEAR(fix_covariance(fix, config)(0, 0) + fix_covariance(fix, config)(1, 1), 9.0, 1e-3);
  EXPECT_NEAR(fix_covariance(fix, config)(2, 2), 4.5 * 4.5, 1e-3);
  fix.covariance = Vector3d(0.04, 0.09, 0.16).asDiagonal();
  EXPECT_NEAR(fix_covariance(fix, config)(1, 1), 0.09, 1e-3);
  fix.covariance(0, 1) = fix.covariance(1, 0) = 1.0;  // no covariance
  EXPECT_NEAR(fix_covariance(fix, config)(0, 0), 4.5, 1e-3);
}

TEST(SatelliteFit, SpreadsAndCovariancesAreTheSameErrors) {
  Matrix6d root;
  Random random(4);
  for (int i = 0; i < 36; ++i)
    root(i) = 0.01 * random.normal();
  const Matrix6d spread = root * root.transpose();
  const Vector3d middle(20.0, -30.0, 4.0);
  const Matrix6d right = right_from_spread(spread, enu_from_world(), middle);
  EXPECT_LT((spread_from_right(right, enu_from_world(), middle) - spread).norm(), 1e-12);
  // A turn about the middle, drawn, against a right perturbation.
  const Vector6d eta = root.col(0) * 1e-3;
  const Pose to(Eigen::Quaterniond::Identity(), middle);
  const Pose moved = to * Pose::exp(eta) * to.inverse() * enu_from_world();
  const Vector6d xi = right_difference(moved, enu_from_world());
  const Matrix6d one = eta * eta.transpose();
  EXPECT_LT((right_from_spread(one, enu_from_world(), middle) - xi * xi.transpose()).norm(),
            1e-6 * (xi * xi.transpose()).norm());
}

const Vector3d kLine(0.3, 0.8, 0.1);  // to the second antenna, not along x

// Headings with an error that goes on for twenty seconds; `wrong_deg` is added to all.
void add_headings(const std::vector<StampedPose>& poses, double sd_deg, double wrong_deg,
                  std::uint64_t seed, std::vector<GnssFix>& fixes) {
  Random random(seed);
  double slow = random.normal();
  const double kept = std::exp(-1.0 / 20.0);
  for (std::size_t k = 0; k < fixes.size(); ++k) {
    const Vector3d line =
        enu_from_world().rotation() * (poses[2 * k].world_from_body.rotation() * kLine);
    slow = kept * slow + std::sqrt(1.0 - kept * kept) * random.normal();
    const double heading_deg = std::atan2(line.x(), line.y()) * 180.0 / M_PI;
    fixes[k].heading_deg = std::fmod(heading_deg + wrong_deg + sd_deg * slow + 720.0, 360.0);
    fixes[k].heading_sd_deg = sd_deg;
  }
}

SatelliteFitConfig with_second_antenna() {
  SatelliteFitConfig config = usual_fit();
  config.pairing.second_antenna_in_body = kArm + kLine;
  return config;
}

double heading_error_deg(const SatelliteFit& fit) {
  return std::remainder(yaw_of(fit.enu_from_world) - yaw_of(enu_from_world()), 2.0 * M_PI) * 180.0 /
         M_PI;
}

double heading_sd_deg(const SatelliteFit& fit) {
  return std::sqrt(fit.spread(2, 2)) * 180.0 / M_PI;
}

std::vector<StampedPose> standing() {
  std::vector<StampedPose> poses = walk();
  for (StampedPose& pose : poses)
    pose.world_from_body = Pose(pose.world_from_body.rotation(), {0.01, 0.02, 0.0});
  return poses;
}

// A machine that stands still: positions tell no heading, the second antenna does.
TEST(SatelliteFit, ACarrierThatStandsIsPlacedByItsSecondAntenna) {
  const auto poses = standing();
  double squares = 0.0;
  constexpr int kDraws = 20;
  for (int draw = 0; draw < kDraws; ++draw) {
    const auto seed = static_cast<std::uint64_t>(draw + 1);
    auto fixes = received(poses, {0.8, 60.0, 0.2}, seed);
    EXPECT_FALSE(
        fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, with_second_antenna()).found);
    add_headings(poses, 0.8, 0.0, seed, fixes);
    const auto fits = fits_to_satellites(
        poses, fixes, {SatelliteMethod::kSplit, SatelliteMethod::kFit3}, with_second_antenna());
    ASSERT_TRUE(fits[0].found) << fits[0].reason;
    EXPECT_FALSE(fits[1].found);  // by positions alone
    ASSERT_TRUE(fits[0].headings);
    EXPECT_TRUE(fits[0].headings->used);
    EXPECT_TRUE(std::isnan(fits[0].headings->off_rad));
    EXPECT_LT(rms_error_m(fits[0], poses), 3.0);
    squares += std::pow(heading_error_deg(fits[0]) / heading_sd_deg(fits[0]), 2.0) / kDraws;
  }
  EXPECT_LT(squares, 1.5);  // the line itself is right here
}

TEST(SatelliteFit, ASecondAntennaMakesTheHeadingBetter) {
  const auto poses = walk();
  double with = 0.0;
  double without = 0.0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    auto fixes = received(poses, {6.0, 200.0, 0.5, 2.0, 0.0, 3.0}, seed);
    without += std::pow(heading_error_deg(fit_to_satellites(poses, fixes, SatelliteMethod::kSplit,
                                                            with_second_antenna())),
                        2.0);
    add_headings(poses, 0.5, 0.0, seed, fixes);
    const SatelliteFit fit =
        fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, with_second_antenna());
    ASSERT_TRUE(fit.headings && fit.headings->used);
    EXPECT_LT(std::abs(heading_error_deg(fit)), 3.0 * heading_sd_deg(fit));
    with += std::pow(heading_error_deg(fit), 2.0);
  }
  EXPECT_LT(with, 0.1 * without);
}

// Antennas that are swapped, or a place of one that is wrong by a quarter turn.
TEST(SatelliteFit, HeadingsThatContradictThePositionsAreLeftOut) {
  const auto poses = walk();
  for (const double wrong_deg : {180.0, 90.0, -30.0}) {
    auto fixes = received(poses, {1.0, 60.0, 0.3}, 3);
    const SatelliteFit without =
        fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, with_second_antenna());
    add_headings(poses, 0.5, wrong_deg, 4, fixes);
    const SatelliteFit fit =
        fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, with_second_antenna());
    ASSERT_TRUE(fit.found && fit.headings);
    EXPECT_FALSE(fit.headings->used);
    EXPECT_NEAR(std::abs(fit.headings->off_rad) * 180.0 / M_PI, std::abs(wrong_deg), 3.0);
    EXPECT_EQ(yaw_of(fit.enu_from_world), yaw_of(without.enu_from_world));
    EXPECT_EQ(fit.expected_error_m, without.expected_error_m);
  }
}

// The fixes five times a second, and every fifth from `first` on moved by `change`.
std::vector<GnssFix> with_false_fixes(const std::vector<StampedPose>& poses, std::size_t first,
                                      std::size_t step,
                                      const std::function<void(GnssFix&)>& change) {
  std::vector<GnssFix> fixes = received(poses, {.slow_m = 0.3, .fast_m = 0.1}, 5);
  for (std::size_t k = first; k < fixes.size(); k += step)
    change(fixes[k]);
  return fixes;
}

// A regression: fixes of an interval were averaged before anything robust saw them. One in each
// moved the whole map, and the stated error stayed small.
TEST(SatelliteFit, OneFalseFixOfEachIntervalDoesNotMoveTheRun) {
  const std::vector<StampedPose> poses = walk();
  const auto no_place = [](GnssFix& fix) {
    fix.latitude_deg = fix.longitude_deg = fix.height_m = 0.0;
  };
  const auto north = [](GnssFix& fix) { fix.latitude_deg += 100.0 / 111e3; };
  const auto low = [](GnssFix& fix) { fix.height_m = 0.0; };
  for (const std::function<void(GnssFix&)>& change :
       {std::function<void(GnssFix&)>(no_place), std::function<void(GnssFix&)>(north),
        std::function<void(GnssFix&)>(low)}) {
    const std::vector<GnssFix> fixes = with_false_fixes(poses, 2, 5, change);
    const SatelliteFit fit =
        fit_to_satellites(poses, fixes, SatelliteMethod::kSplit, usual_fit(), {});
    ASSERT_TRUE(fit.found) << fit.reason;
    EXPECT_LT(rms_error_m(fit, poses), 0.6);
    EXPECT_LT(fit.plane_rms_m, 1.0);
    for (std::size_t k = 0; k < fixes.size(); ++k)
      EXPECT_EQ(fit.fixes[k].used, k % 5 != 2) << k;
  }
}

// Regressions: the first fix told the frame, and one fix far away made the run "not of these
// fixes".
TEST(SatelliteFit, ASingleFalseFixIsLeftOutWhereverItIs) {
  const std::vector<StampedPose> poses = walk();
  const std::size_t fixes = poses.size() / 2;
  for (const std::size_t at : {std::size_t{0}, fixes / 2}) {
    const SatelliteFit fit = fit_to_satellites(
        poses, with_false_fixes(poses, at, fixes, [](GnssFix& fix) { fix.latitude_deg -= 10.0; }),
        SatelliteMethod::kSplit, usual_fit(), {});
    ASSERT_TRUE(fit.found) << fit.reason;
    EXPECT_LT((EastNorthUp(kPlace).from_place(*fit.origin)).norm(), 1'000.0);
    EXPECT_LT(rms_error_m(fit, poses), 0.6);
    EXPECT_LT(fit.plane_rms_m, 1.0);
    EXPECT_FALSE(fit.fixes[at].used);
  }
}

// Of a receiver with one fix a second nothing is compared within an interval.
TEST(SatelliteFit, AFalseFixThatHasAnIntervalOfItsOwnDoesNotTellHowGoodTheFitIs) {
  const std::vector<StampedPose> poses = walk();
  SatelliteFitConfig config = usual_fit();
  config.pairing.most_pairs = 10'000;
  const SatelliteFit fit = fit_to_satellites(
      poses, with_false_fixes(poses, 300, 600, [](GnssFix& fix) { fix.latitude_deg -= 10.0; }),
      SatelliteMethod::kSplit, config, {});
  ASSERT_TRUE(fit.found) << fit.reason;
  EXPECT_LT(rms_error_m(fit, poses), 0.6);
  EXPECT_LT(fit.plane_rms_m, 1.0);
  EXPECT_GT(fit.all_plane_rms_m, 1'000.0);
  EXPECT_GT(fit.left_out_share, 0.0);
  EXPECT_FALSE(fit.fixes[300].used);
}

TEST(SatellitePairs, TheWayOfTheAntennaIsNoError) {
  GatheredPair pair;
  for (int k = 0; k < 10; ++k) {
    SatellitePair one;
    one.time_s = 0.1 * k;
    one.antenna_in_world = {5.0 * k, 0.0, 0.0};
    one.fix_in_enu = {0.0, 5.0 * k, 0.0};
    one.fixes = 1;
    pair.add(one);
  }
  EXPECT_EQ(pair.mean().fixes, 10U);
}

TEST(SatellitePairs, AFixWithoutAHeightIsNotLeftOutForIt) {
  GatheredPair pair;
  for (int k = 0; k < 5; ++k) {
    SatellitePair one;
    one.time_s = 0.2 * k;
    one.has_height = k % 2 == 1;  // most have none
    one.fix_in_enu = {0.1 * k, 0.0, one.has_height ? 150.0 : 0.0};
    one.fixes = 1;
    pair.add(one);
  }
  EXPECT_EQ(pair.mean().fixes, 5U);
  EXPECT_FALSE(pair.mean().has_height);
}

}  // namespace
}  // namespace understory
