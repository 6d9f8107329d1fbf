#include "understory/odometry/dense/dense_odometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "understory/odometry/test_carrier.h"
#include "understory/registration/ndt/ndt_matcher.h"
#include "understory/registration/test_stand.h"

namespace understory {
namespace {

constexpr double kScanPeriodS = 0.1;

// Somebody who walks straight on and looks left and right quickly, in a world whose origin is the
// first pose.
Pose world_from_walker(double t) {
  const double soft = 1.0 - std::exp(-2.0 * t * t);  // from rest
  const Eigen::Vector3d position(0.8 * t * soft, 0.05 * std::sin(5.0 * t) * soft, 0.0);
  return {so3_exp({0.0, 0.0, 0.6 * std::sin(4.5 * t) * soft}), position};
}

class LookingAround : public ::testing::Test {
 protected:
  LookingAround() {
    stand_ = testing::make_stand({.half_width_m = 12.0, .crowns = false}, 4);
    for (testing::Stem& stem : stand_.stems)
      stem.foot.z() -= kEyes;
    pattern_ = testing::vlp16();
    pattern_.columns = 360;
  }

  // The ground of a stand is at height 0, the walker's eyes are the origin.
  [[nodiscard]] Points seen_from(const Pose& world_from_body, std::uint64_t seed) const {
    const Pose ground_from_world(Eigen::Quaterniond::Identity(), {0.0, 0.0, kEyes});
    testing::Stand stand = stand_;
    for (testing::Stem& stem : stand.stems)
      stem.foot.z() += kEyes;
    return testing::scan_stand(stand, ground_from_world * world_from_body, pattern_, seed);
  }

  // One turn of the lidar that begins at `t`.
  [[nodiscard]] Scan scan(double t) const {
    Scan scan;
    scan.stamp = TestCarrier::stamp(t);
    constexpr int kSteps = 8;
    for (int step = 0; step < kSteps; ++step) {
      const Pose pose = world_from_walker(t + kScanPeriodS * (step + 0.5) / kSteps);
      for (const Eigen::Vector3f& p : seen_from(pose, static_cast<std::uint64_t>(1e3 * t) + 7)) {
        const double turned = std::atan2(p.y(), p.x()) / (2.0 * std::numbers::pi) + 0.5;
        if (static_cast<int>(turned * kSteps) != step) continue;
        scan.points.push_back({p.x(), p.y(), p.z(), 1.0F,
                               static_cast<std::uint32_t>(1e9 * kScanPeriodS * turned), 0, 0, 0});
      }
    }
    return scan;
  }

  [[nodiscard]] MatchTargetPtr map() const {
    const auto builder =
        make_matcher({.cell_sizes_m = {0.5}, .cells = {}, .steps = {}})->make_builder({});
    for (int i = -3; i <= 6; ++i) {
      const Pose pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.4 * i, 0.1 * (i % 3), 0.0));
      builder->insert(seen_from(pose, static_cast<std::uint64_t>(20 + i)), pose, std::nullopt);
    }
    return builder->snapshot();
  }

  // RMS error of position over 1.4 seconds, metres.
  [[nodiscard]] double rms_error(DenseOdometryConfig config, StageTimes& times) const {
    Log log;
    DenseOdometry odometry(config, Rig(), nullptr, times, log);
    odometry.set_initial_motion(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    const MatchTargetPtr local_map = map();
    double sum = 0.0;
    constexpr int kScans = 14;
    for (int i = 0; i < kScans; ++i) {
      const double t = kScanPeriodS * i;
      const Scan turn = scan(t);
      const DenseEstimate estimate = odometry.process(turn, local_map);
      EXPECT_EQ(estimate.scan_end, turn.end());
      const Pose off = world_from_walker(t).inverse() * estimate.state.world_from_body;
      sum += off.translation().squaredNorm();
    }
    return std::sqrt(sum / kScans);
  }

  static constexpr double kEyes = 1.7;
  testing::Stand stand_;
  testing::Pattern pattern_;
};

bool timed(const StageTimes& times, const std::string& stage) {
  const std::vector<std::string> stages = times.stages();
  return std::find(stages.begin(), stages.end(), stage) != stages.end();
}

TEST_F(LookingAround, ScansWithoutAnImuAreMatchedElastically) {
  DenseOdometryConfig config;
  StageTimes rigid_times;
  config.elastic_scans = false;
  const double rigid = rms_error(config, rigid_times);
  StageTimes times;
  config.elastic_scans = true;
  const double elastic = rms_error(config, times);
  EXPECT_FALSE(timed(rigid_times, "matching_elastic"));
  EXPECT_TRUE(timed(times, "matching_elastic"));
  EXPECT_LT(elastic, 0.022);
  EXPECT_LT(elastic, 0.8 * rigid);
}

// Three points of a second lidar for each of the first one, where nothing is mapped.
Scan with_another_lidar(Scan scan, std::uint16_t first_ring) {
  const std::vector<ScanPoint> own = scan.points;
  for (int copy = 1; copy <= 3; ++copy) {
    for (ScanPoint point : own) {
      point.z += 40.0F * static_cast<float>(copy);
      point.ring = first_ring;
      scan.points.push_back(point);
    }
  }
  return scan;
}

TEST_F(LookingAround, ALidarThatJoinsIsNoReasonToDoubtTheMatch) {
  Rig rig;
  rig.further_lidars.push_back({Pose(), kRingsALidar});
  const auto last_of = [&](std::uint16_t first_ring) {
    StageTimes times;
    Log log;
    DenseOdometry odometry({}, rig, nullptr, times, log);
    odometry.set_initial_motion(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    const MatchTargetPtr local_map = map();
    for (int i = 0; i < 3; ++i)
      EXPECT_TRUE(odometry.process(scan(kScanPeriodS * i), local_map).matched);
    return odometry.process(with_another_lidar(scan(kScanPeriodS * 3), first_ring), local_map);
  };
  EXPECT_TRUE(last_of(kRingsALidar).matched);
  // The same points by the lidar that was there before are a reason.
  const DenseEstimate doubted = last_of(0);
  EXPECT_FALSE(doubted.matched);
  EXPECT_EQ(doubted.match.reason, "suddenly much less than before");
}

// Notes which lidars the points of a match are of, and matches nothing.
class LidarsOfMatch : public MatchTarget {
 public:
  explicit LidarsOfMatch(std::vector<std::uint8_t>& seen) : seen_(seen) {}
  RegistrationResult match(const Points& source, const Pose& /*guess*/, const PoseTerms& /*terms*/,
                           MatchStart /*start*/) const override {
    seen_.assign(source.size(), 0);
    return {};
  }
  RegistrationResult match_features(const FeaturePoints& source, const Pose& /*guess*/,
                                    const PoseTerms& /*terms*/,
                                    MatchStart /*start*/) const override {
    seen_ = source.lidars;
    EXPECT_EQ(seen_.size(), source.points.size());
    return {};
  }
  double reach_m() const override { return 0.5; }
  std::size_t size() const override { return 1; }

 private:
  std::vector<std::uint8_t>& seen_;
};

TEST_F(LookingAround, AMatchKnowsWhichLidarMeasuredAPoint) {
  Rig rig;
  rig.further_lidars.push_back({Pose(), kRingsALidar});
  const auto share_of_second = [&](std::uint16_t first_ring) {
    StageTimes times;
    Log log;
    DenseOdometry odometry({}, rig, nullptr, times, log);
    odometry.set_initial_motion(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    std::vector<std::uint8_t> lidars;
    const auto target = std::make_shared<const LidarsOfMatch>(lidars);
    static_cast<void>(odometry.process(with_another_lidar(scan(0.0), first_ring), target));
    const auto of_second = std::count(lidars.begin(), lidars.end(), 1);
    return static_cast<double>(of_second) / static_cast<double>(lidars.size());
  };
  EXPECT_NEAR(share_of_second(kRingsALidar), 0.75, 0.02);
  EXPECT_EQ(share_of_second(0), 0.0);
}

// A scan of another place: its points lie beside the surfaces of the map.
Scan scattered(Scan scan) {
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const auto at = static_cast<float>(i);
    scan.points[i].x += 0.35F * std::sin(1.3F * at);
    scan.points[i].y += 0.35F * std::sin(1.7F * at);
    scan.points[i].z += 0.35F * std::sin(2.3F * at);
  }
  return scan;
}

TEST_F(LookingAround, FewPointsCountIfTheyLieOnTheMapsSurfaces) {
  const auto last_of = [&](double few_found_residual, const Scan& last) {
    StageTimes times;
    Log log;
    DenseOdometryConfig config;
    config.match.few_found_residual = few_found_residual;
    DenseOdometry odometry(config, Rig(), nullptr, times, log);
    odometry.set_initial_motion(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    const MatchTargetPtr local_map = map();
    for (int i = 0; i < 3; ++i)
      EXPECT_GT(odometry.process(scan(kScanPeriodS * i), local_map).found_share, 0.9);
    return odometry.process(last, local_map);
  };
  // Most of what it sees is not in the map, as where a scan's rings lie between those of the map.
  const Scan mostly_new = with_another_lidar(scan(kScanPeriodS * 3), 0);
  EXPECT_FALSE(last_of(0.0, mostly_new).matched);
  const DenseEstimate counted = last_of(1.5, mostly_new);
  EXPECT_TRUE(counted.matched);
  EXPECT_LT(counted.found_share, 0.5);
  EXPECT_FALSE(last_of(1.5, scattered(mostly_new)).matched);
}

// P4 (36): what matches nothing makes the fitness worse, and the pose less sure.
TEST_F(LookingAround, AScanThatIsMostlyNewIsLessSure) {
  const auto variance_after = [&](const Scan& last, double threshold_m2) {
    StageTimes times;
    Log log;
    DenseOdometryConfig config;
    config.match.few_found_residual = 1.5;
    config.motion.lidar.source = LidarNoise::kFitness;
    config.motion.lidar.fitness_threshold_m2 = threshold_m2;
    config.motion.lidar.fitness_scale = 1000.0;
    DenseOdometry odometry(config, Rig(), nullptr, times, log);
    odometry.set_initial_motion(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    const MatchTargetPtr local_map = map();
    for (int i = 0; i < 3; ++i)
      EXPECT_TRUE(odometry.process(scan(kScanPeriodS * i), local_map).matched);
    const DenseEstimate estimate = odometry.process(last, local_map);
    EXPECT_TRUE(estimate.matched);
    return estimate.state.pose_covariance.diagonal().tail<3>().sum();
  };
  const Scan seen = scan(kScanPeriodS * 3);
  const Scan mostly_new = with_another_lidar(seen, 0);
  EXPECT_GT(variance_after(mostly_new, 0.1), 4.0 * variance_after(seen, 0.1));
  EXPECT_NEAR(variance_after(mostly_new, 1.0), variance_after(seen, 1.0),
              0.05 * variance_after(seen, 1.0));
}

// A bar that goes along 0.8 m to the left of the lidar, before all else, and a box around some of
// what follows.
Scan with_a_bar(const Scan& scan) {
  Scan with = scan;
  with.points.clear();
  for (int i = 0; i < 400; ++i) {
    const auto along = 0.002F * static_cast<float>(i);
    with.points.push_back({0.0F, 0.8F, along - 0.4F, 1.0F, 0, 0, 0, 0});
  }
  for (int i = 0; i < 50; ++i)
    with.points.push_back({0.0F, -0.8F, 0.0F, 1.0F, 0, 0, 0, 0});
  with.points.insert(with.points.end(), scan.points.begin(), scan.points.end());
  return with;
}

bool is_of_bar(const Eigen::Vector3f& point) {
  return std::abs(point.x()) < 0.2F && std::abs(point.y() - 0.8F) < 0.2F &&
         std::abs(point.z()) < 0.45F;
}

TEST_F(LookingAround, WhatGoesAlongIsNotMatched) {
  const std::string boxes = ::testing::TempDir() + "dense_odometry_test_boxes.yaml";
  std::ofstream(boxes) << "boxes: [{name: seat, frame: lidar, center_m: [0, -0.8, 0], "
                          "rotation_deg: [0, 0, 0], size_m: [0.2, 0.2, 0.2]}]\n";
  const MatchTargetPtr local_map = map();
  for (const double reach : {3.0, 0.0}) {
    StageTimes times;
    Log log;
    DenseOdometryConfig config;
    config.elastic_scans = false;
    config.machine_boxes_file = boxes;
    config.carried.reach_m = reach;
    DenseOdometry odometry(config, Rig(), nullptr, times, log);
    odometry.set_initial_motion(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    for (int i = 0; i < 5; ++i) {
      const Scan bare = scan(kScanPeriodS * i);
      const DenseEstimate estimate = odometry.process(with_a_bar(bare), local_map);
      ASSERT_EQ(estimate.cloud.size(), bare.points.size() + 400);
      std::size_t of_bar = 0;
      for (std::size_t k = 0; k < 400; ++k)
        of_bar += estimate.cloud.is_carried(k) ? 1 : 0;
      EXPECT_EQ(of_bar, reach > 0.0 ? 400U : 0U) << i;
      std::size_t others = 0;
      for (std::size_t k = 400; k < estimate.cloud.size(); ++k)
        others += estimate.cloud.is_carried(k) ? 1 : 0;
      // Stems near by are not known to be none before the walker moves.
      EXPECT_LT(others, bare.points.size() / (i < 3 ? 4 : 20)) << i;
      const Points& matched = estimate.thinned.points;
      EXPECT_EQ(std::any_of(matched.begin(), matched.end(), is_of_bar), reach == 0.0) << i;
    }
  }
}

// A bright return that stands alone is no weather, and the weather filter is the one to judge it.
// Without it, or without intensities, the filter of lone returns does.
TEST(LoneReturns, AreJudgedByTheWeatherFilterWhereItCan) {
  Scan turn;
  turn.stamp = TestCarrier::stamp(0.0);
  turn.ring_count = 2;
  for (int i = 0; i < 200; ++i) {
    turn.points.push_back({3.0F, -2.0F + 0.02F * static_cast<float>(i), 0.0F, 100.0F,
                           static_cast<std::uint32_t>(i) * 1000U, 0, 0, 0});
  }
  turn.points[100].x = 1.5F;
  const auto left = [&](bool enabled, float of_another) {
    turn.points[50].intensity = of_another;
    DenseOdometryConfig config;
    config.weather.enabled = enabled;
    StageTimes times;
    Log log;
    DenseOdometry odometry(config, Rig(), nullptr, times, log);
    return odometry.process(turn, nullptr).cloud.size();
  };
  EXPECT_EQ(left(false, 90.0F), 199U);
  EXPECT_EQ(left(true, 90.0F), 200U);
  EXPECT_EQ(left(true, 100.0F), 199U) << "no intensities";
}

}  // namespace
}  // namespace understory
